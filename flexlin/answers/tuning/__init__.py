"""Gains tuned for all scenarios at once: the slowest decay made as fast as it can be."""
