"""Transition matrices by Radau IIA collocation: modes that decay too fast for any step vanish, as they should."""

from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import legvander

from flexlin.checks import Array
from flexlin.periodic.system import MatrixFunction
from flexlin.periodic.transition.gauss import Tableau, collect_chunks, sample_at, solve_stages


@lru_cache(maxsize=16)
def radau(stages: int) -> Tableau:
    """Return the s-stage Radau IIA tableau; c_s = 1, so the last stage is the step's result.

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


def radau_transitions(A: MatrixFunction, edges: Array, stages: int) -> Array:
    """Transition matrices of x' = A(t) x over the segments between consecutive edges.

        Y_i = I + h sum_j a_ij A_j Y_j,   Phi = Y_s

    L-stable: a mode with h Re lambda -> -infinity is damped to nothing, where Gauss collocation would keep it undamped.
    The error is O(h^(2 stages - 1)), less on stiff modes. A is taken just before an edge, so jumps there do no harm.

    Parameters: A: function (N,) -> (N, n, n); edges: increasing times (K + 1,); stages >= 1.
    Returns: Phi (K, n, n).
    """
    rule, h = radau(stages), np.diff(edges)

    def part(t: Array, k: slice) -> Array:
        t = np.minimum(t, np.nextafter(edges[1:][k], -np.inf)[:, None])
        hA = sample_at(A, t) * h[k, None, None, None]
        right = np.broadcast_to(np.eye(hA.shape[-1]), hA.shape)
        return solve_stages(hA, rule, right)[:, -1]

    return collect_chunks(part, edges, rule)
