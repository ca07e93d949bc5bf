"""Floquet exponents with their errors, the modes behind them, and how both move with the coefficients."""
