"""The edges of an integration's steps: times that no step passes over, and how long steps should be between them.

Breaks and narrow features of the motion, and where a law changes fast, are such times. Lengths are found by local errors, and read by
the next windows and runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from flexlin.checks import Array
from flexlin.linearization.law import Law, VectorFunction
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficient_series.panels import first_edges
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficients import Combined, MatrixFunction, has_nothing_narrow
from flexlin.periodic.interpolation import ChebyshevPanels, edges_of_short
from flexlin.precision import SLIGHT
from flexlin.simulation.window import Grid, Path, Rule

BREAK_DISTANCE = 1e-12
"""How far beside a break of the motion what holds there is taken, in periods."""
SHORT_PARTS = 64
"""Of the period: panels that are shorter begin and end with a step."""
STEP_SAFETY = 0.9
"""A step is this much shorter than its error would have it."""
STEP_CHANGE = (0.02, 2.0)
"""How much shorter or longer than a step that was tried one is wished for."""
MARK_REMAINDER = SLIGHT
"""Of a step: what is left to the mark joins the steps before."""
CLOSE_EDGE = 0.1
"""Of a step: an edge so near to a narrow time makes place for it."""
FIRST_STEP, STEP_GROWTH, WIDEST_STEP = 1 / 2048, 1.3, 1 / 8
"""Steps behind a start, where fast modes ring: the first at tolerance 1e-6, in periods; how each is longer than the last; the longest."""


@dataclass(frozen=True)
class Mesh:
    """Wished lengths (K,) of steps between edges (K + 1,) in time; behind the last edge steps stay as long as the last."""

    edges: Array
    lengths: Array

    @classmethod
    def graded(cls, t: float, period: float, stages: int, tol: float) -> "Mesh":
        """Steps from a time on of whose errors nothing is known."""
        first = period * FIRST_STEP * (1e6 * tol) ** (1 / (stages + 1))
        count = 1 + int(np.log(max(1.0, WIDEST_STEP * period / first)) / np.log(STEP_GROWTH))
        lengths = first * STEP_GROWTH ** np.arange(count)
        return cls(t + np.append(0.0, np.cumsum(lengths)), lengths)

    def moved(self, t: float) -> "Mesh":
        """The same from another time on."""
        return Mesh(self.edges + (t - self.edges[0]), self.lengths)

    def next_edges(self, t: float, mark: float, most: int, reach: float, narrow: Array) -> Array:
        """Edges (k + 1,) of at most so many steps from t on, to the mark at the farthest, the narrow times among them.

        A step goes further than t + reach only alone.
        """
        tail = np.full(most, self.lengths[-1])
        edges = np.concatenate([self.edges, max(self.edges[-1], t) + np.cumsum(tail)])
        passed = np.append(0.0, np.cumsum(np.diff(edges) / np.append(self.lengths, tail)))
        begin, end = np.interp([t, mark], edges, passed)
        if mark > edges[-1] or end - begin > most:
            found = np.interp(begin + np.arange(most + 1), passed, edges)
        else:
            found = np.interp(
                np.linspace(begin, end, max(1, int(np.ceil(end - begin - MARK_REMAINDER))) + 1), passed, edges
            )
            found[-1] = mark
        found[0] = t
        found = with_narrow(found, narrow)[: most + 1]
        inside = max(1, int(np.searchsorted(found, t + reach, side="right")) - 1)
        found = found[: inside + 1]
        return np.array([t, t + reach]) if found[-1] > t + reach else found

    def learn(self, edges: Array, ratio: Array, order: int, good: int) -> tuple["Mesh", "Mesh"]:
        """The mesh of the first `good` steps of a window, and behind them, by their errors against the allowed ones, of order h^order."""
        with np.errstate(divide="ignore", over="ignore"):
            factor = np.clip(STEP_SAFETY * ratio ** (-1 / order), *STEP_CHANGE)
        wished = np.diff(edges) * np.where(np.isfinite(ratio), factor, STEP_CHANGE[0])
        beside = np.concatenate([wished[:1], wished, wished[-1:]])
        wished = np.minimum(wished, np.minimum(beside[:-2], beside[2:]))
        known = int(np.sum(self.edges > edges[-1]))
        ahead = np.concatenate([edges[good:], self.edges[len(self.edges) - known :]])
        lengths = np.concatenate([wished[good:], self.lengths[len(self.lengths) - known :]])
        if not len(lengths):
            later = wished[len(wished) // 2 :].min()
            ahead, lengths = edges[-1] + np.array([0.0, later]), np.array([later])
        return Mesh(edges[: good + 1], wished[:good]), Mesh(ahead, lengths)

    def shortened(self, t: float, step: float) -> "Mesh":
        """Steps of this length from a time on."""
        return Mesh(t + np.array([0.0, step]), np.array([step]))

    @staticmethod
    def joined(parts: list["Mesh"]) -> "Mesh":
        """Meshes that follow each other as one."""
        lengths = np.concatenate([part.lengths for part in parts])
        return Mesh(join_edges([part.edges for part in parts]), lengths)


def with_narrow(edges: Array, narrow: Array) -> Array:
    """Edges of steps, and those of the narrow times that lie between them, in whose place edges close by go."""
    narrow = narrow[(narrow > edges[0]) & (narrow < edges[-1])]
    if not len(narrow):
        return edges
    inner, steps = edges[1:-1], np.minimum(np.diff(edges)[:-1], np.diff(edges)[1:])
    apart = np.abs(inner[:, None] - narrow).min(axis=1)
    return np.sort(np.concatenate([edges[[0, -1]], narrow, inner[apart > CLOSE_EDGE * steps]]))


def join_edges(parts: Sequence[Array]) -> Array:
    """The edges of steps that follow each other, each part beginning where the last one ends."""
    return np.concatenate([*(edges[:-1] for edges in parts), parts[-1][-1:]])


@dataclass(frozen=True)
class Trail:
    """The mesh of a run, for its tol; the edges (K + 1,) of its steps and the accelerations (K, s, n) at their stages."""

    mesh: Mesh
    tol: float
    edges: Array
    w: Array

    @classmethod
    def of(cls, meshes: list[Mesh], windows: list[tuple[Array, Array]], tol: float) -> "Trail":
        """That of windows that follow each other."""
        edges, w = zip(*windows, strict=True)
        return cls(Mesh.joined(meshes), tol, join_edges(edges), np.concatenate(w))

    def mesh_for(self, tol: float, stages: int) -> Mesh:
        """The mesh for a run with another tol and as many stages."""
        return Mesh(self.mesh.edges, self.mesh.lengths * (tol / self.tol) ** (1 / (stages + 1)))

    def follow(self, grid: Grid, start: Array) -> Path:
        """The motion from a state (2n,) with these accelerations, by the polynomials through the stages."""
        stages, n = self.w.shape[1:]
        which = np.clip(np.searchsorted(self.edges, grid.times) - 1, 0, len(self.w) - 1)
        begin = self.edges[which]
        inside = (grid.times - begin) / (self.edges[which + 1] - begin)
        shares = inside[..., None] ** np.arange(stages) @ Rule.of(stages).powers
        w = (shares[..., None, :] @ self.w[which])[..., 0, :]
        h, rule = grid.h[:, None], grid.rule.tableau
        x = np.empty((grid.count + 1, 2 * n))
        x[:, n:] = start[n:] + np.append(np.zeros((1, n)), np.cumsum(h * (rule.b @ w), axis=0), axis=0)
        moved = h * x[:-1, n:] + h**2 * ((rule.b * (1 - rule.c)) @ w)
        x[:, :n] = start[:n] + np.append(np.zeros((1, n)), np.cumsum(moved, axis=0), axis=0)
        return grid.path(x, w)


def law_times(lin: Linearization, t: Array) -> Array:
    """The times (N,) at which a law is asked: in the period, and after the end of a one-way motion as it is there."""
    return t % lin.period if lin.motion.periodic else np.minimum(t, lin.period)


def with_breaks(t: Array, lin: Linearization, rough: Array) -> Array:
    """The times t, and between them all that lie in their periods as the rough ones do in the first."""
    T = lin.period
    if not len(rough):
        return t
    rounds = T * np.arange(np.floor(t[-1] / T) + 1) if lin.motion.periodic else np.zeros(1)
    breaks = np.unique(np.add.outer(rounds, np.append(rough, T)).ravel())
    inside = breaks[(breaks > t[0]) & (breaks < t[-1])]
    near = np.abs(inside[:, None] - t[np.clip(np.searchsorted(t, inside)[:, None] + [-1, 0], 0, len(t) - 1)]).min(
        axis=1
    )
    return np.sort(np.concatenate([t, inside[near > 1e-12 * T]]))


def mark_times(ends: Array, lin: Linearization, rough: Array) -> tuple[Array, Array]:
    """The ends of windows, and the narrow times, of a motion between its ends: those of its first period again and again."""
    marks = with_breaks(ends, lin, rough)
    return marks, np.setdiff1d(with_breaks(marks, lin, find_narrow_times(lin)), marks)


def find_rough_times(law: Law, lin: Linearization) -> Array:
    """Times in [0, T) that no window passes over: breaks of the motion, and what the law adds.

    Raises: UnresolvedCoefficient, NotPeriodic as `resolve`.
    """
    own = (part for part in (law.forward, law.reference) if not (is_rigid(part) or has_nothing_narrow(part)))
    edges = [
        np.array(lin.breaks, dtype=float),
        find_edges(law.gain, lin),
        *(find_edges(Combined(partial(np.expand_dims, axis=2), (part,)), lin) for part in own),
    ]
    if not lin.complete:
        edges.append(np.array(lin.periodic_system().resolved.breaks) if lin.motion.periodic else find_edges(lin.A, lin))
    return np.unique(np.concatenate(edges))


def find_narrow_times(lin: Linearization) -> Array:
    """Times in [0, T) about which the linear equations change in a short time: named ones, or where these may not be all, what is found."""
    T = lin.period
    if lin.complete:
        edges = first_edges(T, np.array(lin.breaks, dtype=float), np.reshape(lin.features, (-1, 2)))
    elif lin.motion.periodic:
        edges = lin.periodic_system().resolved.edges
    else:
        return np.empty(0)
    return np.unique(np.mod(edges_of_short(edges, T / SHORT_PARTS), T))


def is_rigid(part: VectorFunction) -> bool:
    """Whether a torque is that of the rigid motion, which changes fast where the motion says so."""
    return isinstance(getattr(part, "__self__", None), Linearization)


def find_edges(part: MatrixFunction, lin: Linearization) -> Array:
    """Times in [0, T) at which a law's part is not smooth, and about which it changes in a short time. Raises: as `resolve`."""
    T = lin.period
    if isinstance(part, ChebyshevPanels):
        return part.edges[:-1]
    if has_nothing_narrow(part):
        return np.empty(0)
    periodic = lin.motion.periodic
    breaks = sorted({*lin.breaks, *([] if periodic else [0.0])})
    found = resolve(part, T, breaks, lin.features, repeats=periodic)
    return np.union1d(found.breaks, np.mod(edges_of_short(found.edges, T / SHORT_PARTS), T))
