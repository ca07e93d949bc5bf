"""Zeros of many functions at once, each kept between two points of unlike sign."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array

MOST_STEPS = 200
"""Steps of a search; halving alone needs some 50, and a size may be as far off as doubling goes."""


@dataclass(frozen=True)
class SignedEnds:
    """Two points (V,) each and the values there, of unlike sign; the first is the latest point."""

    a: Array
    b: Array
    at_a: Array
    at_b: Array

    @property
    def best(self) -> Array:
        """The point whose value is nearer to zero."""
        return np.where(np.abs(self.at_a) <= np.abs(self.at_b), self.a, self.b)

    @property
    def width(self) -> Array:
        return np.abs(self.b - self.a)


def solve_brackets(
    function: Callable[[Array, Array], Array],
    start: SignedEnds,
    accuracy: Array | float,
    affords: Callable[[int], bool] = lambda _: True,
) -> SignedEnds:
    """Narrow brackets until they are as wide as `accuracy`, by inverse quadratic interpolation where that is safe, else by halves.

    Parameters: function: (indices (W,), points (W,)) -> values (W,), all brackets that are still wide in one call;
    affords: whether so many values more may be computed; brackets stay wide where not.
    Source: Chandrupatla, A new hybrid quadratic/bisection algorithm, Advances in Engineering Software 28 (1997).
    """
    a, b, at_a, at_b = (np.array(values, dtype=float) for values in (start.a, start.b, start.at_a, start.at_b))
    limit = np.broadcast_to(accuracy, a.shape)
    t = np.full(a.shape, 0.5)
    for _ in range(MOST_STEPS):
        which = np.flatnonzero((np.abs(b - a) > limit) & (at_a != 0) & (at_b != 0))
        if not len(which) or not affords(len(which)):
            break
        x1, x2, f1, f2 = a[which], b[which], at_a[which], at_b[which]
        x = x1 + t[which] * (x2 - x1)
        f = function(which, x)
        same = np.sign(f) == np.sign(f1)
        x3, f3 = np.where(same, x1, x2), np.where(same, f1, f2)
        a[which], at_a[which] = x, f
        b[which], at_b[which] = np.where(same, x2, x1), np.where(same, f2, f1)
        t[which] = choose_steps(x, b[which], x3, f, at_b[which], f3, limit[which])
    return SignedEnds(a, b, at_a, at_b)


def solve_uncertain(
    function: Callable[[Array, Array], tuple[Array, Array]],
    start: SignedEnds,
    accuracy: float,
    affords: Callable[[int], bool] = lambda _: True,
) -> tuple[SignedEnds, Array]:
    """As `solve_brackets`, of functions with an error each; also how far from zero the best point's value may be, (V,)."""
    seen = dict[tuple[int, float], float]()

    def note(which: Array, points: Array) -> Array:
        values, errors = function(which, points)
        seen.update(zip(zip(which.tolist(), points.tolist(), strict=True), errors.tolist(), strict=True))
        return values

    ends = solve_brackets(note, start, accuracy, affords)
    missing = np.array([k for k, x in enumerate(ends.best.tolist()) if (k, x) not in seen], dtype=int)
    if len(missing):
        note(missing, ends.best[missing])
    left = np.minimum(np.abs(ends.at_a), np.abs(ends.at_b))
    return ends, left + np.array([seen[key] for key in enumerate(ends.best.tolist())])


def choose_steps(x1: Array, x2: Array, x3: Array, f1: Array, f2: Array, f3: Array, limit: Array) -> Array:
    """Where to look next, as a share of the way from x1 to x2; never nearer to an end than a part of the limit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        place, value, alpha = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2), (x3 - x1) / (x2 - x1)
        safe = (1 - np.sqrt(1 - place) < value) & (value < np.sqrt(place))
        share = f1 / (f1 - f2) * f3 / (f3 - f2) - alpha * f1 / (f3 - f1) * f2 / (f2 - f3)
        least = np.minimum(0.4 * limit / np.abs(x2 - x1), 0.5)
    return np.where(safe & np.isfinite(share), np.clip(share, least, 1 - least), 0.5)
