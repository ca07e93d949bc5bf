"""Assumed modes of a link and their integrals; numpy and scipy only."""
