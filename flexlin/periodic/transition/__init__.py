"""Transition matrices over the segments of a period: Gauss, Radau, Magnus, and the choice among them."""
