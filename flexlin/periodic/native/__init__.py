"""Compiled code of the numeric wing: C sources, and the library made of them."""
