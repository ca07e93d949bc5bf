"""Lyapunov certificates of stability: a periodic X(t) > 0 whose inequality is proved over the whole period."""
