"""The periodic motion that a periodic force makes."""
