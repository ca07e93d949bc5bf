"""Stability over many values of scene parameters."""
