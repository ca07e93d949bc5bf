"""Transition matrices of whole periods for many systems at once, by Gauss collocation in the accelerations."""

from collections.abc import Sequence

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.grid import place_edges
from flexlin.periodic.many.romberg import Coefficients
from flexlin.periodic.product.balancing import multiply_pairs
from flexlin.periodic.transition.gauss import collocate_accelerations, gauss, place_nodes


def batched_transitions(coefficients: Coefficients, segments: int, stages: int, breaks: Sequence[float] = ()) -> Array:
    """Transition matrices (V, 2 n, 2 n) of y'' = X(phase) y + Y(phase) y' over one period, for V values.

    Multiplied out: for simulation and comparison, not for exponents far apart (see `batched_exponents`).

    Parameters: coefficients: phases (N,) -> X, Y (N, n, n, V); stages: of the Gauss method, order 2 stages.
    """
    rule, grid = gauss(stages), place_edges(1.0, breaks, segments)
    t = place_nodes(grid, rule.c)
    K, D = (np.moveaxis(-A, -1, 0).reshape(-1, *t.shape, *A.shape[1:3]) for A in coefficients(t.ravel()))
    h = np.broadcast_to(np.diff(grid), K.shape[:2])
    factors = np.moveaxis(collocate_accelerations(np.broadcast_to(np.eye(K.shape[-1]), K.shape), D, K, h, rule), 1, 0)
    while len(factors) > 1:
        factors = multiply_pairs(factors)
    return factors[0]
