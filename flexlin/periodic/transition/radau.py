"""Radau IIA collocation: modes that decay too fast for any step vanish, as they should."""

from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import legvander

from flexlin.periodic.transition.gauss import Tableau


@lru_cache(maxsize=16)
def radau(stages: int) -> Tableau:
    """Return the s-stage Radau IIA tableau; c_s = 1, so the last stage is the step's result.

    L-stable: a mode with h Re lambda -> -infinity is damped to nothing, where Gauss collocation would keep it undamped. The error is
    O(h^(2 stages - 1)), less on stiff modes.
    Source: Hairer, Wanner, Solving ODEs II, IV.5; the inner nodes are the zeros of the Jacobi polynomial P^(1,0)_(s-1), eigenvalues
    of its recurrence (Golub, Welsch 1969).
    """
    k = np.arange(1, stages)
    diagonal, beside = -1 / ((2 * k - 1) * (2 * k + 1)), np.sqrt(k * (k + 1.0)) / (2 * k + 1)
    x = np.append(np.linalg.eigvalsh(np.diag(diagonal) + np.diag(beside[:-1], -1)), 1.0)
    P = legvander(x, stages)
    integral = np.column_stack([(1 + x) / 2, (P[:, 2:] - P[:, :-2]) / (2 * (2 * k + 1))])
    a = np.linalg.solve(P[:, :stages].T, integral.T).T
    return Tableau((1 + x) / 2, a, a[-1])
