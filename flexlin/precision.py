"""Double precision: its rounding, the powers of it by which what is the same is known, and shares of a whole that count for little."""

import numpy as np

EPS, TINY = float(np.finfo(float).eps), float(np.finfo(float).tiny)
ROOT_EPS, CUBE_ROOT_EPS = float(np.sqrt(EPS)), float(np.cbrt(EPS))
"""1.5e-8 and 6e-6: the relative size to which rounding parts double and threefold eigenvalues."""
FAINT, FOURTH_ROOT_EPS = CUBE_ROOT_EPS * CUBE_ROOT_EPS, float(np.sqrt(ROOT_EPS))
"""4e-11: what rounding makes of sums that cancel; 1e-4: of fourfold eigenvalues."""
LARGEST_LOG_GROWTH = 300.0
"""Logarithm of the largest growth that says anything: doubles hold its square."""
SLIGHT, MINOR, PARTIAL = 1e-3, 0.1, 0.3
"""Shares of a whole: one that changes no decision, one that is small beside it, and one that is clearly less than it."""
SAFETY = 4.0
"""Multiple of the largest deviation seen that is stated as error."""
