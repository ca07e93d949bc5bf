"""Norms of a periodic system from its inputs to an output: H2 and H-infinity."""
