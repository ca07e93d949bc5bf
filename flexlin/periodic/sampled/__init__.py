"""Loops whose input is computed at sampling instants and held: exact discrete-time models, lifted over a period, and their stability."""
