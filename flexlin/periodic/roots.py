"""Zeros of many functions at once, each kept between two points of unlike sign."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array

MOST_STEPS = 200
"""Steps of a search; halving alone needs some 50, and a size may be as far off as doubling goes."""


UncertainFunction = Callable[[Array, Array], tuple[Array, Array]]
"""Indices (W,) and points (W,) -> values (W,) and their errors (W,)."""


@dataclass(frozen=True)
class SignedEnds:
    """Two points each (2, V), the first the latest, with the functions' values there, of unlike sign, and the errors of these."""

    points: Array
    values: Array
    errors: Array

    @classmethod
    def between(cls, function: UncertainFunction, points: Array) -> "SignedEnds":
        """The points (2, V) with what the function says there."""
        values, errors = zip(*(function(np.arange(len(one)), one) for one in points), strict=True)
        return cls(points, np.array(values), np.array(errors))

    @property
    def best(self) -> tuple[Array, Array, Array]:
        """The point whose value is nearer to zero, that value's size, and its error, (V,) each."""
        nearer = np.abs(self.values).argmin(axis=0), np.arange(self.values.shape[1])
        return self.points[nearer], np.abs(self.values[nearer]), self.errors[nearer]

    @property
    def width(self) -> Array:
        """Between the two points, (V,)."""
        return np.asarray(np.abs(self.points[1] - self.points[0]))


def solve_brackets(
    function: UncertainFunction,
    start: SignedEnds,
    accuracy: float,
    affords: Callable[[int], bool] = lambda _: True,
) -> SignedEnds:
    """Narrow brackets until they are as wide as `accuracy`, by inverse quadratic interpolation where that is safe, else by halves.

    Parameters: function: called with all brackets that are still wide at once;
    affords: whether so many values more may be computed; brackets stay wide where not.
    Source: Chandrupatla, A new hybrid quadratic/bisection algorithm, Advances in Engineering Software 28 (1997).
    """
    found = SignedEnds(start.points.copy(), start.values.copy(), start.errors.copy())
    t = np.full(len(start.width), 0.5)
    for _ in range(MOST_STEPS):
        which = np.flatnonzero((found.width > accuracy) & (found.values != 0).all(axis=0))
        if not len(which) or not affords(len(which)):
            break
        (x1, x2), (f1, f2) = found.points[:, which], found.values[:, which]
        x = x1 + t[which] * (x2 - x1)
        f, error = function(which, x)
        same = np.sign(f) == np.sign(f1)
        for known, latest in ((found.points, x), (found.values, f), (found.errors, error)):
            known[:, which] = latest, np.where(same, known[1, which], known[0, which])
        three = np.array([*found.points[:, which], np.where(same, x1, x2)])
        t[which] = choose_steps(three, np.array([*found.values[:, which], np.where(same, f1, f2)]), accuracy)
    return found


def choose_steps(x: Array, f: Array, limit: float) -> Array:
    """Where to look next, as a share of the way from the first to the second of three points (3, W), of which the third was left out last;
    never nearer to an end than a part of the limit."""
    (x1, x2, x3), (f1, f2, f3) = x, f
    with np.errstate(divide="ignore", invalid="ignore"):
        place, value, alpha = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2), (x3 - x1) / (x2 - x1)
        safe = (1 - np.sqrt(1 - place) < value) & (value < np.sqrt(place))
        share = f1 / (f1 - f2) * f3 / (f3 - f2) - alpha * f1 / (f3 - f1) * f2 / (f2 - f3)
        least = np.minimum(0.4 * limit / np.abs(x2 - x1), 0.5)
    return np.where(safe & np.isfinite(share), np.clip(share, least, 1 - least), 0.5)
