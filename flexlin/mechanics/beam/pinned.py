"""Shapes of a beam that turns freely at its base, alone or with a hub, and its tip free."""

import numpy as np

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.mechanics.beam.uniform import UniformShapes, solve_modes


def pinned_free(n: int) -> UniformShapes:
    """Return the n lowest elastic modes of a uniform beam pinned at its base: tan(beta) = tanh(beta)."""
    return pinned_with_hub(n)


def pinned_with_hub(n: int, hub_inertia: float = 0.0) -> UniformShapes:
    """Return the n lowest elastic modes of a uniform beam on a hub that turns freely.

        X(0) = 0,   X''(0) = -hub_inertia beta^4 X'(0),   X''(1) = X'''(1) = 0

    The rigid mode X = xi is left out: the joint angle stands for it, and the modes are orthogonal to it
    (int xi X + hub_inertia X'(0) = 0).

    Parameters: hub_inertia / (rhoA l^3). Returns: modes with int X^2 = 1 along the beam, X'(0) > 0.
    Raises: ArgumentError when the inertia is negative.
    Source: Bellezza, Lanari, Ulivi (1990), the "pseudo-clamped" and "pseudo-pinned" frames.
    """
    hub_inertia = float(real_array("hub_inertia", hub_inertia, ()))
    if hub_inertia < 0:
        raise ArgumentError("the hub's inertia is negative", got=hub_inertia, expected="0 or more")

    def boundary(beta: Array, start: Array, end: Array) -> Array:
        base = start[:, 2] + hub_inertia * beta[:, None] ** 3 * start[:, 1]
        return np.stack([start[:, 0], base, end[:, 2], end[:, 3]], axis=1)

    return solve_modes(n, boundary, lowest=0.5)
