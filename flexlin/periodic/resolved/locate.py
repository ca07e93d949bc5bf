"""Places where a coefficient is not smooth, found by bisection between the polynomials on their two sides."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.chebyshev import chebyshev_basis, chebyshev_nodes, chebyshev_transform
from flexlin.periodic.resolved.sampling import Sampler

STENCIL, REACH = 8, 4.0
"""Nodes of the polynomial on either side, and its length in brackets."""
PARTS = 16
"""Parts into which one step divides a bracket."""
SHORTEST = 1e-9
"""Shortest stencil, of the period: it stays longer than the bracket, so rounding is not amplified."""
SCAN, WINDOW = 64, 4
"""Times of the first scan of a panel, and how many of their intervals make the first bracket."""


@dataclass
class Brackets:
    """Intervals (low, high), each with a place where A is not smooth, inside rooms (floor, roof) where it is smooth otherwise."""

    low: Array
    high: Array
    floor: Array
    roof: Array

    def some(self, which: Array) -> "Brackets":
        """A part of them."""
        return Brackets(self.low[which], self.high[which], self.floor[which], self.roof[which])


def scan(sample: Sampler, begin: Array, end: Array, allowed: Array) -> tuple[Brackets, Array]:
    """Bracket the roughest window of each panel by its fourth difference; and whether there is room for stencils beside it (P,)."""
    width = end - begin
    t = begin[:, None] + width[:, None] * (np.arange(SCAN) + 0.5) / SCAN
    values = sample(t.ravel()).reshape(len(begin), SCAN, -1)
    rough = (np.abs(np.diff(values, WINDOW, axis=1)) / allowed[:, None]).max(axis=2)
    first = rough.argmax(axis=1)
    rows = np.arange(len(begin))
    low, high = t[rows, first], t[rows, first + WINDOW]
    room = np.minimum(low - begin, end - high) >= (high - low) / 2
    return Brackets(low, high, begin, end), room & (rough[rows, first] > 1)


def locate(sample: Sampler, brackets: Brackets, allowed: Array) -> tuple[Array, Array]:
    """Narrow brackets (Q,) until the two sides agree to `allowed` (Q, E) across them, or they end at neighbouring floats.

    p_- and p_+ interpolate A on stencils below and above the bracket. Among the parts of the bracket the cut s is taken at which

        sum_(i < s) |A - p_-|(x_i) + sum_(i >= s) |A - p_+|(x_i)

    is least, so a jump is followed to the last bit, and a kink until it no longer shows. A function that is smooth ends early.
    Returns: the first time of the upper side (Q,) and the width of the last bracket (Q,).
    """
    place, width = brackets.high.copy(), brackets.high - brackets.low
    open_ = np.arange(len(place))
    while len(open_):
        part = brackets.some(open_)
        cut, apart = _cut(sample, part, allowed[open_])
        brackets.low[open_], brackets.high[open_] = cut
        width[open_] = cut[1] - cut[0]
        narrow = width[open_] <= 1.01 * np.spacing(np.abs(cut[1]))
        stuck = width[open_] >= part.high - part.low
        done = narrow | stuck | ~apart
        place[open_] = np.where(narrow | apart, cut[1], (cut[0] + cut[1]) / 2)
        open_ = open_[~done]
    return place, width


def _cut(sample: Sampler, part: Brackets, allowed: Array) -> tuple[tuple[Array, Array], Array]:
    """One step: the new brackets, and whether the sides were still apart across the old ones."""
    low, high, span = part.low, part.high, part.high - part.low
    reach = np.maximum(REACH * span, SHORTEST * sample.period)
    below, above = np.minimum(reach, low - part.floor), np.minimum(reach, part.roof - high)
    inner = low[:, None] + span[:, None] * np.arange(1, PARTS) / PARTS
    u = chebyshev_nodes(STENCIL)
    left, right = low[:, None] + below[:, None] * (u - 1) / 2, high[:, None] + above[:, None] * (u + 1) / 2
    t = np.concatenate([left, right, inner], axis=1)
    values = sample(t.ravel()).reshape(*t.shape, -1) / allowed[:, None]
    line = np.concatenate([low[:, None], inner, high[:, None]], axis=1)
    before = _extrapolated(values[:, :STENCIL], 2 * (line - low[:, None]) / below[:, None] + 1)
    after = _extrapolated(values[:, STENCIL : 2 * STENCIL], 2 * (line - high[:, None]) / above[:, None] - 1)
    inside = values[:, 2 * STENCIL :]
    to_left = np.abs(inside - before[:, 1:-1]).sum(axis=2)
    to_right = np.abs(inside - after[:, 1:-1]).sum(axis=2)
    zero = np.zeros((len(low), 1))
    cost = np.hstack([zero, to_left.cumsum(axis=1)]) + np.hstack([to_right[:, ::-1].cumsum(axis=1)[:, ::-1], zero])
    s, rows = cost.argmin(axis=1), np.arange(len(low))
    growth = chebyshev_basis(1 + 2 * span / np.minimum(below, above), STENCIL)[:, -1]
    apart = np.abs(before - after).max(axis=(1, 2)) > 4 + 0.02 * growth
    return (line[rows, s], line[rows, s + 1]), apart


def _extrapolated(values: Array, u: Array) -> Array:
    """The interpolants of values (Q, STENCIL, E) at u (Q, L): (Q, L, E)."""
    return chebyshev_basis(u, STENCIL) @ (chebyshev_transform(STENCIL) @ values)
