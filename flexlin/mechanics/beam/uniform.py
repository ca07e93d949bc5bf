"""Exact modes of a uniform Euler-Bernoulli beam for any boundary conditions, stable up to high orders.

    X'''' = beta^4 X,   X = c1 cos(beta xi) + c2 sin(beta xi) + c3 exp(-beta xi) + c4 exp(-beta (1 - xi))

The two exponentials decay from the two ends, so nothing overflows and no cosh - sinh cancels.
"""

from collections.abc import Callable

import numpy as np

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError, ToleranceNotReached
from flexlin.mechanics.beam.integrals import Shapes, gauss_legendre

Boundary = Callable[[Array, Array, Array], Array]
"""Boundary conditions: (beta, basis at xi = 0, basis at xi = 1) -> (N, 4, 4); a basis is (N, derivative, function)."""

SCAN_STEP = 0.02
"""Width of the scan for roots; roots of a uniform beam lie near pi apart."""


class UniformShapes(Shapes):
    """Modes of a uniform beam from roots beta (n,) and coefficients (n, 4) in the stable basis."""

    def __init__(self, beta: Array, coefficients: Array):
        self.beta, self.coefficients, self.n = beta, coefficients, len(beta)
        self.order = 40 + 3 * self.n  # resolves cos(2 beta xi) and the boundary layers

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return X or its derivative with respect to xi: (N,) -> (n, N)."""
        return np.einsum("nb,nNb->nN", self.coefficients, basis(self.beta[:, None], np.asarray(xi), derivative))


def basis(beta: Array, xi: Array, derivative: int) -> Array:
    """Return the derivative of (cos, sin, exp from the left, exp from the right) on a new last axis."""
    phase = beta * xi + derivative * np.pi / 2
    left, right = (-1.0) ** derivative * np.exp(-beta * xi), np.exp(-beta * (1 - xi))
    return np.asarray(beta**derivative)[..., None] * np.stack([np.cos(phase), np.sin(phase), left, right], axis=-1)


def boundary_matrix(beta: Array, boundary: Boundary) -> Array:
    """Return the matrix (N, 4, 4) that is singular at a root, its rows scaled to unit size."""
    one, decayed = np.ones_like(beta), np.exp(-beta)
    start = scaled_derivatives(one, np.zeros_like(beta), one, decayed)
    rows = boundary(beta, start, scaled_derivatives(np.cos(beta), np.sin(beta), decayed, one))
    return rows / np.linalg.norm(rows, axis=2, keepdims=True)


def scaled_derivatives(cos: Array, sin: Array, left: Array, right: Array) -> Array:
    """Return the basis and its derivatives over beta, beta^2, beta^3 at one place, (N, derivative, function), from its values (N,)."""
    turned = (cos, sin, left, right), (-sin, cos, -left, right), (-cos, -sin, left, right), (sin, -cos, -left, right)
    return np.moveaxis(np.array(turned), 2, 0)


def solve_modes(n: int, boundary: Boundary, lowest: float = 1e-3) -> UniformShapes:
    """Find the n lowest modes of a uniform beam.

        det boundary_matrix(beta) = 0,   boundary_matrix(beta) c = 0,   int_0^1 X^2 = 1

    Assumes that no root lies below `lowest` (rigid modes have beta = 0 and are left out) and that roots lie further apart than SCAN_STEP.

    Parameters: n modes; boundary: the four conditions in scaled derivatives X^(d) / beta^d.
    Returns: modes whose curvature at the base, or slope where that is zero, is positive.
    Raises: ToleranceNotReached when fewer than n roots are found.
    """
    if not n:
        return UniformShapes(np.zeros(0), np.zeros((0, 4)))

    def determinant(beta: Array) -> Array:
        return np.linalg.det(boundary_matrix(beta, boundary))

    # below beta = 0.1 the scan is logarithmic: a heavy tip drives the first root towards zero
    grid = np.concatenate([np.geomspace(lowest, 0.1, 200), np.arange(0.1, np.pi * (n + 2), SCAN_STEP)[1:]])
    values = determinant(grid)
    brackets = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)[:n]
    if len(brackets) < n:
        raise ToleranceNotReached("not all roots of the beam were found", got=len(brackets), expected=f"{n} roots")
    beta = narrow(determinant, grid[brackets], grid[brackets + 1], values[brackets], values[brackets + 1])
    null = np.linalg.svd(boundary_matrix(beta, boundary))[2][:, -1, :]
    return normalised(UniformShapes(beta, null))


def narrow(function: Callable[[Array], Array], low: Array, high: Array, at_low: Array, at_high: Array) -> Array:
    """The root in each bracket (n,), by Ridders' method for all together; `at_low` and `at_high` are the function's values at its ends.

    Each step at least halves the bracket, and near a simple root doubles the digits.
    Source: Ridders, A new algorithm for computing a single root of a real continuous function, IEEE Trans. Circuits Syst. 26 (1979).
    """
    last = high
    while True:
        middle = (low + high) / 2
        at_middle = function(middle)
        size = np.sqrt(at_middle**2 - at_low * at_high) + np.finfo(float).tiny
        root = middle + (middle - low) * np.sign(at_low - at_high) * at_middle / size
        if (np.abs(root - last) <= 4 * np.spacing(root)).all():
            return root
        last, at_root = root, function(root)
        inside, below = (np.sign(value) != np.sign(at_root) for value in (at_middle, at_low))
        low = np.where(inside, middle, np.where(below, low, high))
        at_low = np.where(inside, at_middle, np.where(below, at_low, at_high))
        high, at_high = root, at_root


def normalised(shapes: UniformShapes) -> UniformShapes:
    """Scale to int X^2 = 1 and to a positive curvature at the base (a positive slope where the base is pinned)."""
    nodes, weights = gauss_legendre(shapes.order + 16)
    size = np.sqrt(shapes.values((nodes + 1) / 2) ** 2 @ weights / 2)
    start = np.zeros(1)
    slope, curvature = (shapes.values(start, d)[:, 0] / shapes.beta**d for d in (1, 2))
    sign = np.where(np.abs(slope) > np.sqrt(np.finfo(float).eps) * size, np.sign(slope), np.sign(curvature))
    return UniformShapes(shapes.beta, shapes.coefficients * (sign / size)[:, None])


def clamped_free(n: int) -> UniformShapes:
    """Return the n lowest modes of a uniform cantilever.

        X = cosh(beta xi) - cos(beta xi) - sigma (sinh(beta xi) - sin(beta xi)),   1 + cos(beta) cosh(beta) = 0

    so that int X^2 = 1, X(1) = 2, -2, 2 ...

    Source: any textbook of vibrations, e.g. Blevins (1979), Table 8-1.
    """
    return clamped_with_tip(n)


def clamped_with_tip(n: int, mass: float = 0.0, inertia: float = 0.0) -> UniformShapes:
    """Return the n lowest modes of a uniform beam, clamped, with a rigid body on its tip.

        X(0) = X'(0) = 0,   X''(1) = beta^4 inertia X'(1),   -X'''(1) = beta^4 mass X(1)

    Parameters: mass / (rhoA l), inertia about the tip / (rhoA l^3); int X^2 = 1 along the beam.
    Raises: ArgumentError when the numbers cannot belong to a rigid body.
    Source: De Luca, Siciliano (1991), Eqs (9)-(11), without a first moment.
    """
    mass, inertia = (float(real_array(name, value, ())) for name, value in (("mass", mass), ("inertia", inertia)))
    if mass < 0 or inertia < 0:
        raise ArgumentError("no rigid body has this mass and inertia", got=(mass, inertia), expected="0 or more")

    def boundary(beta: Array, start: Array, end: Array) -> Array:
        b = beta[:, None]
        bending = end[:, 2] - inertia * b**3 * end[:, 1]
        shear = end[:, 3] + mass * b * end[:, 0]
        return np.stack([start[:, 0], start[:, 1], bending, shear], axis=1)

    return solve_modes(n, boundary)


def pinned_with_hub(n: int, hub_inertia: float = 0.0) -> UniformShapes:
    """Return the n lowest elastic modes of a uniform beam on a hub that turns freely; without inertia tan(beta) = tanh(beta).

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
