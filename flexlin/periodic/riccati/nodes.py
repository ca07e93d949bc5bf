"""Where X(t) is known while its equation is solved: equally spaced times of a period, or Chebyshev's extreme points of panels."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from flexlin.checks import Array
from flexlin.periodic.coefficient_series.sampling import JUMP_WIDTH
from flexlin.periodic.interpolation import (
    FINER_BOUNDS,
    ChebyshevPanels,
    FourierSeries,
    circle_derivative,
    divide_evenly,
    divide_segments,
    fourier_nodes,
    harmonics,
    shifted,
    weigh_harmonics,
)
from flexlin.precision import EPS, MINOR, SAFETY, TINY

SHOWN_WAVES = 0.36
"""Waves that N equally spaced nodes show, as a part of N: a correction of the next ones could grow, see `FourierNodes.sharpen`."""
PANEL_DEGREE = 16
"""Of the polynomials on panels."""
LOST_WAVES = SAFETY * EPS
"""Waves below this part of the largest are rounding."""


@dataclass(frozen=True)
class FourierNodes:
    """N equally spaced times of a period, N even."""

    count: int
    period: float

    wraps = True

    @property
    def t(self) -> Array:
        """The times (N,)."""
        return fourier_nodes(self.count, self.period)

    places = t
    """The times at which X stands."""

    @property
    def between(self) -> Array:
        """The times half-way between."""
        return self.t + 0.5 * self.period / self.count

    def place_behind(self, values: Array) -> Array:
        """Values at the times between as those of the nodes before them."""
        return values

    @property
    def halves(self) -> Array:
        """From each node half-way to the one before it, and to the next, which is as long: (1, N)."""
        return np.full((1, self.count), 0.5 * self.period / self.count)

    @property
    def edges(self) -> Array:
        """One panel: the period."""
        return np.array([0.0, self.period])

    def slopes(self, X: Array) -> Array:
        """X' (N, n, n) at the nodes."""
        return circle_derivative(X - X[0], self.period)

    def sharpen(self, D: Array, gaps: bool = False) -> Array:
        """The waves of a D that was found by half steps, without those that the nodes do not show; gaps: by Hermite's rule.

            D / (x / tan x),   D / (x / tan x + x^2 / 3),   x = w h / 2

        So D' = -F is solved exactly. A fast mode needs no such factor; with one below 2 the corrections converge for it too.
        """
        waves, turn = np.fft.rfft(D, axis=0), np.pi / self.count * np.arange(1, int(SHOWN_WAVES * self.count))
        waves[1 : 1 + len(turn)] /= (turn / np.tan(turn) + gaps * turn**2 / 3)[:, None, None]
        waves[1 + len(turn) :] = 0.0
        return np.fft.irfft(waves, self.count, axis=0)

    def smooth(self, F: Array) -> Array:
        """The lower half of the waves that are shown."""
        return weigh_harmonics(F, np.abs(harmonics(self.count)) < int(SHOWN_WAVES / 2 * self.count))

    def look_between(self, X: Array) -> tuple[Array, Array]:
        """X and X' at the times between."""
        apart = X - X[0]
        return X[0] + shifted(apart, 0.5), circle_derivative(apart, self.period, 0.5)

    def series(self, X: Array) -> FourierSeries:
        """X as a series without waves that are rounding."""
        every = FourierSeries.through(X, self.period)
        mean, high = every.coefficients[:1], np.maximum(*map(np.abs, every.waves))
        root = np.sqrt(np.abs(np.diagonal(mean[0])))  # entries of a cost are as large as the states' units make them
        kept = int(np.flatnonzero((high > LOST_WAVES * np.outer(root, root)).any(axis=(1, 2))).max(initial=-1)) + 1
        return FourierSeries(np.concatenate([mean, *(one[:kept] for one in every.waves)]), self.period)

    def tail(self, X: Array) -> float:
        """The size of the highest waves that are shown."""
        return float(self._heights(X)[-self.count // 16 :].max())

    def refine(self, X: Array, seen: float) -> "FourierNodes | None":
        """As many nodes as the fall of X's waves says are needed to show all above `seen`; none where these do."""
        heights = self._heights(X)
        shown, high = len(heights), float(heights[-self.count // 16 :].max())
        if high <= max(seen, LOST_WAVES):
            return None
        half = max(float(heights[shown // 2 - self.count // 16 : shown // 2].max()), 2 * high)
        needed = 1 + 0.5 * np.log(high / (MINOR * seen)) / np.log(half / high)
        step = max(16, 2 ** int(np.log2(self.count)) // 8)
        return FourierNodes(step * int(np.ceil(self.count * np.clip(needed, *FINER_BOUNDS) / step)), self.period)

    def resize(self, count: int) -> "FourierNodes":
        """So many."""
        return FourierNodes(count, self.period)

    def _heights(self, X: Array) -> Array:
        waves = np.abs(np.fft.rfft(X, axis=0)).max(axis=(1, 2)) * (2 / self.count)
        return np.asarray(waves[: int(SHOWN_WAVES * self.count)]) + TINY


@dataclass(frozen=True, eq=False)
class PanelNodes:
    """Chebyshev's extreme points of panels between edges from 0 to T, every inner edge twice: from the left and from the right.

    wraps: whether X repeats.
    """

    edges: Array
    wraps: bool

    @property
    def period(self) -> float:
        """The last edge."""
        return float(self.edges[-1])

    @property
    def count(self) -> int:
        """The number of nodes."""
        return (len(self.edges) - 1) * (PANEL_DEGREE + 1)

    @property
    def t(self) -> Array:
        """The times (N,), those of the edges just inside the panels."""
        return self._place(np.clip(lobatto()[0], JUMP_WIDTH - 1, 1 - JUMP_WIDTH))

    @property
    def places(self) -> Array:
        """The times at which X stands: edges are edges."""
        return np.minimum(self._place(lobatto()[0]), np.nextafter(self.period, 0.0))

    @property
    def between(self) -> Array:
        """Times between the nodes: the zeros of T_p."""
        return self._place(lobatto(0.5)[0])

    def place_behind(self, values: Array) -> Array:
        """Values at the times between as those of the nodes before them; a panel's last node has the last ones, too."""
        parts = values.reshape(-1, PANEL_DEGREE, *values.shape[1:])
        return np.concatenate([parts, parts[:, -1:]], axis=1).reshape(-1, *values.shape[1:])

    @property
    def halves(self) -> Array:
        """From each node half-way to the one before it, and to the next: (2, N)."""
        gaps = 0.25 * np.outer(np.diff(self.edges), np.diff(lobatto()[0]))
        nothing = np.zeros((len(gaps), 1))
        return np.stack([np.hstack([nothing, gaps]).ravel(), np.hstack([gaps, nothing]).ravel()])

    def slopes(self, X: Array) -> Array:
        """X' (N, n, n) at the nodes."""
        return self._apply(lobatto()[2], X, True)

    def sharpen(self, D: Array, gaps: bool = False) -> Array:
        """D as it is: it was found by steps of unequal length."""
        return D

    def smooth(self, F: Array) -> Array:
        """F as it is."""
        return F

    def look_between(self, X: Array) -> tuple[Array, Array]:
        """X and X' at the times between."""
        _, values, slopes, _ = lobatto(0.5)
        return self._apply(values, X), self._apply(slopes, X, True)

    def series(self, X: Array) -> ChebyshevPanels:
        """X as polynomials."""
        return ChebyshevPanels(self.edges, self._apply(lobatto()[3], X).reshape(-1, PANEL_DEGREE + 1, *X.shape[1:]))

    def tail(self, X: Array) -> float:
        """The size of the last terms."""
        return float(self._heights(X).max())

    def refine(self, X: Array, seen: float) -> "PanelNodes | None":
        """Panels divided where their last terms are above `seen`; none where none is."""
        excess = self._heights(X) / max(seen, LOST_WAVES)
        if excess.max() <= 1:
            return None
        parts = np.clip(np.ceil(excess ** (1 / (PANEL_DEGREE + 1))), 1, 4).astype(int)
        return PanelNodes(np.unique(divide_evenly(self.edges, parts)), self.wraps)

    def resize(self, count: int) -> "PanelNodes":
        """Each panel divided until there are so many: panels are few at first. One of a rounding's length leaves no room for more."""
        return PanelNodes(np.unique(divide_segments(self.edges, max(1, round(count / self.count)))), self.wraps)

    def _heights(self, X: Array) -> Array:
        """The largest of the last terms of each panel (P,)."""
        return np.asarray(np.abs(self.series(X).coefficients)[:, -3:].max(axis=(1, 2, 3)) + TINY)

    def _place(self, u: Array) -> Array:
        return np.asarray((self.edges[:-1, None] + np.outer(np.diff(self.edges), 0.5 * (u + 1))).ravel())

    def _apply(self, matrix: Array, X: Array, by_time: bool = False) -> Array:
        found = matrix @ X.reshape(len(self.edges) - 1, PANEL_DEGREE + 1, -1)
        if by_time:
            found *= (2 / np.diff(self.edges))[:, None, None]
        return np.asarray(found.reshape(-1, *X.shape[1:]))


Nodes = FourierNodes | PanelNodes


@lru_cache
def lobatto(shift: float = 0.0) -> tuple[Array, Array, Array, Array]:
    """Chebyshev's extreme points (or, by a shift of 1/2, the zeros of T_p between them), the matrices from values at extreme points to
    values and slopes at these, and to coefficients."""
    extreme, u = (-np.cos(np.pi * np.arange(shift, PANEL_DEGREE + 1 - shift) / PANEL_DEGREE) for shift in (0.0, shift))
    to_coefficients = np.linalg.inv(chebyshev.chebvander(extreme, PANEL_DEGREE))
    derivatives = chebyshev.chebder(np.eye(PANEL_DEGREE + 1), axis=0)
    slopes = chebyshev.chebvander(u, PANEL_DEGREE - 1) @ derivatives @ to_coefficients
    slopes[:, : len(u)] -= np.diag(slopes.sum(axis=1))
    return u, chebyshev.chebvander(u, PANEL_DEGREE) @ to_coefficients, slopes, to_coefficients
