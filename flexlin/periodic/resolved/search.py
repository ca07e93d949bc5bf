"""The search for the panels of a period: divided, cut where the coefficient is not smooth, checked off the nodes.

Places where a coefficient is not smooth are found by bisection between the polynomials on their two sides.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexlin.checks import Array
from flexlin.errors import UnresolvedCoefficient
from flexlin.periodic.chebyshev import chebyshev_basis, chebyshev_nodes, chebyshev_transform
from flexlin.periodic.resolved.panels import (
    MOST_PANELS,
    NODES,
    TAIL,
    PanelSet,
    fitted,
    groups,
    left_over,
    rough_edges,
)
from flexlin.periodic.resolved.sampling import (
    EPS,
    NAMED,
    NEAR,
    Sampler,
    graded,
    need_repeatability,
    noise_level,
    stratified,
)

STENCIL = 8
"""Nodes of the polynomial on either side of a place, which is as long as half as many brackets."""
NARROWEST = 1e-13
"""Width, of the period, below which a panel is not divided any more."""
MEMORY = 100_000_000
"""Bytes that the coefficients of all panels may take."""
SHORTEST = 1e-9
"""Shortest stencil, of the period: it stays longer than the bracket, so rounding is not amplified."""


class PanelResolver:
    """The state of the refinement: resolved panels, the edges found, and the check points that once failed.

    Parameters: edges to start from; named: the breaks among them; checks: times in [0, T) at which panels are held against A; wary: whether
    to look for other jumps close to each edge.
    """

    def __init__(self, sample: Sampler, tol: float, edges: Array, named: Array, checks: Array, wary: bool):
        self.sample, self.tol, self.checks = sample, tol, checks
        self.named, self.wary = named, wary
        self.settled: set[float] = set(named.tolist())
        entries = len(sample.scale)
        self.done = PanelSet.empty(entries)
        self.witness_times, self.witness_values = np.empty(0), np.empty((0, entries))
        self.start = edges
        self._rough: tuple[PanelSet, tuple[Array, Array]] | None = None

    def run(self) -> None:
        """Refine until nodes, edges and check points agree.

        Raises: UnresolvedCoefficient.
        """
        todo = fitted(self.sample, self.start[:-1], self.start[1:])
        while len(todo.begin):
            self.resolve_on_nodes(todo)
            todo = self.settle_edges()
            if not len(todo.begin):
                failed = self.check()
                todo = self.refined(failed) if len(failed.begin) else failed

    def resolved(self, panels: PanelSet) -> Array:
        """Whether the last coefficients of each panel have vanished and its earlier failures are met (Q,)."""
        allowed = self.allowed(panels)
        good = np.all(np.abs(panels.coefficients[:, -TAIL:]).max(axis=1) <= allowed / 4, axis=1)
        return np.asarray(good & ~panels.misses(self.witness_times, self.witness_values, allowed))

    def resolve_on_nodes(self, todo: PanelSet) -> None:
        """Refine panels until all are resolved."""
        while len(todo.begin):
            good = self.resolved(todo)
            self.done = self.done.joined(todo.some(good))
            todo = self.refined(todo.some(~good))

    def refined(self, panels: PanelSet) -> PanelSet:
        """Accept panels that are at their noise; cut the others where they are not smooth, or in the middle."""
        if not len(panels.begin):
            return panels
        for part in groups(len(panels.begin)):
            measured = noise_level(self.sample, panels.begin[part], panels.end[part])
            panels.noise[part] = np.maximum(panels.noise[part], measured)
        good = self.resolved(panels)
        self.done = self.done.joined(panels.some(good))
        panels = panels.some(~good)
        if not len(panels.begin):
            return panels
        self.need_room(panels)
        parts = groups(len(panels.begin))
        cuts = np.concatenate([self.cuts(panels.some(part)) for part in parts])
        begin = np.stack([panels.begin, cuts], axis=1).ravel()
        end = np.stack([cuts, panels.end], axis=1).ravel()
        return fitted(self.sample, begin, end, np.repeat(panels.noise, 2, axis=0))

    def cuts(self, panels: PanelSet) -> Array:
        """One place inside each panel (Q,)."""
        width = panels.width
        middle = panels.begin + width / 2
        allowed = self.allowed(panels)
        brackets, useful = scan(self.sample, panels.begin, panels.end, allowed)
        which = np.flatnonzero(useful & (width > 10 * NARROWEST * self.sample.period))
        place, last = locate(self.sample, brackets.some(which), allowed[which])
        sharp, off = last / width[which], np.abs(place - middle[which]) / width[which]
        margin = np.minimum(place - panels.begin[which], panels.end[which] - place)
        kept = ((sharp < 1e-4) | ((sharp < 1 / 300) & (off < 0.25))) & (margin > NARROWEST * self.sample.period)
        self.settled.update(place[kept].tolist())
        middle[which[kept]] = place[kept]
        return middle

    def need_room(self, panels: PanelSet) -> None:
        """Refuse what needs panels that are too narrow or too many."""
        width = panels.width
        worst = int(width.argmin())
        count = len(self.done.begin) + 2 * len(width)
        most = min(MOST_PANELS, MEMORY // (8 * NODES * len(self.sample.scale)))
        if count > NAMED:  # noise of its own would be cut to the last bit
            need_repeatability(self.sample, panels.begin + 0.38 * width, self.tol)
        if width[worst] > NARROWEST * self.sample.period and count <= most:
            return
        middle = panels.begin[worst] + width[worst] / 2
        raise UnresolvedCoefficient(
            f"A(t) cannot be resolved near t = {middle:.15g} s",
            got=f"{count} panels, the narrowest {width[worst]:.3g} s wide",
            expected=f"at most {most} panels, none below {NARROWEST * self.sample.period:.3g} s",
            todo="look at A there: is it bounded? Name jumps in `breaks` and pulses in `features`",
        )

    def rough(self) -> tuple[Array, Array]:
        """Left edges of the panels at which A is not smooth (S,), and whether it jumps there."""
        if self._rough is None or self._rough[0] is not self.done:
            self._rough = self.done, rough_edges(self.done, self.sample, self.tol)
        return self._rough[1]

    def allowed(self, panels: PanelSet) -> Array:
        """What panels may leave over (Q, E)."""
        return left_over(panels, self.sample, self.tol)

    def settle_edges(self) -> PanelSet:
        """Move an edge that only happens to lie near a jump or kink onto it; return the panels to be fitted again."""
        rough, _ = self.rough()
        which = np.flatnonzero(np.isin(self.done.begin, [e for e in rough if float(e) not in self.settled]))
        if not len(which):
            return self.done.some(which)
        panels, T = self.done, self.sample.period
        edge, before = panels.begin[which], which - 1
        ahead, back = panels.end[which] - edge, panels.width[before]
        half = np.minimum(ahead, back) / 64
        allowed = self.allowed(panels)
        brackets = Brackets(edge - half, edge + half, edge - back, edge + ahead)
        place, last = locate(self.sample, brackets, np.maximum(allowed[which], allowed[before]))
        self.settled.update(edge.tolist())
        moved = np.abs(place - edge) > np.maximum(last, 4 * EPS * T)
        place = place[moved]
        self.settled.update(np.mod(place, T).tolist())
        return self._shifted(which[moved], place)

    def _shifted(self, which: Array, place: Array) -> PanelSet:
        """Give the panels `which` other left edges; at the period's ends a narrow panel is set in instead."""
        panels, T = self.done, self.sample.period
        begin, end = panels.begin.copy(), panels.end.copy()
        inner = which > 0
        begin[which[inner]], end[which[inner] - 1] = place[inner], place[inner]
        touched = np.zeros(len(begin), dtype=bool)
        touched[which[inner]], touched[which[inner] - 1] = True, True
        extra: list[tuple[float, float]] = []
        for x in place[~inner]:
            p = -1 if x < 0 else 0
            x = x + T if x < 0 else x
            touched[p] = True
            if min(x - begin[p], end[p] - x) > NARROWEST * T:
                extra.append((float(x), float(end[p])))
                end[p] = x
        self.done = panels.some(~touched)
        starts = np.concatenate([begin[touched], [x for x, _ in extra]])
        ends = np.concatenate([end[touched], [y for _, y in extra]])
        order = np.argsort(starts)
        return fitted(self.sample, starts[order], ends[order]) if len(starts) else panels.some(touched)

    def check(self) -> PanelSet:
        """Compare with A off the nodes where that has not been done; take out the panels that fail and return them."""
        panels = self.done
        t = self.check_times()
        owner = np.clip(np.searchsorted(panels.begin, t, side="right") - 1, 0, len(panels.begin) - 1)
        fresh = ~panels.checked[owner]
        t, owner = t[fresh], owner[fresh]
        panels.checked[:] = True
        allowed, share = 2 * self.allowed(panels), shares(panels, t, owner)
        bad: list[tuple[Array, Array]] = []
        for i in range(0, len(t), self.sample.chunk):
            part = slice(i, i + self.sample.chunk)
            some, stands, values = t[part], share[part], self.sample(t[part])
            starts = np.flatnonzero(np.diff(owner[part], prepend=-1))
            for a, b in pairwise([*starts.tolist(), len(some)]):
                panel = int(owner[part][a])
                apart = panels.compare(panel, some[a:b], values[a:b], stands[a:b], allowed[panel])
                keep = a + np.argsort(-apart, kind="stable")[:TAIL][: np.count_nonzero(apart > 1)]
                bad.append((some[keep], values[keep]))
        np.abs(panels.drift, out=panels.drift)
        times = np.concatenate([np.empty(0), *(x for x, _ in bad)])
        self.witness_times = np.concatenate([self.witness_times, times])
        self.witness_values = np.concatenate([self.witness_values, *(y for _, y in bad)])
        failed = np.isin(np.arange(len(panels.begin)), np.searchsorted(panels.begin, times, side="right") - 1)
        if failed.any():
            self.done = panels.some(~failed)
        return panels.some(failed)

    def check_times(self) -> Array:
        """The given check points, some in every panel, and some ever closer to each edge where A is not smooth."""
        panels, T = self.done, self.sample.period
        own = panels.begin[:, None] + panels.width[:, None] * stratified(NODES // 2, 0.5)
        rough = np.union1d(self.rough()[0], self.named) if self.wary else self.named[:0]
        near = np.mod(graded(rough, NEAR * T, T / 64, np.pi), T)
        t = np.unique(np.concatenate([self.checks, own.ravel(), near]))
        return t[(t >= 0) & (t < T)]


def shares(panels: PanelSet, t: Array, owner: Array) -> Array:
    """The part of its panel for which each of increasing times (N,) stands: half-way to its neighbours, or to the panel's ends."""
    middle = (t[1:] + t[:-1]) / 2
    low = np.maximum(np.append(panels.begin[:1], middle)[: len(t)], panels.begin[owner])
    high = np.minimum(np.append(middle, panels.end[-1:])[: len(t)], panels.end[owner])
    return np.asarray((high - low) / panels.width[owner])


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
    t = begin[:, None] + width[:, None] * (np.arange(2 * NODES) + 0.5) / (2 * NODES)
    values = sample(t.ravel()).reshape(len(begin), 2 * NODES, -1)
    rough = (np.abs(np.diff(values, TAIL, axis=1)) / allowed[:, None]).max(axis=2)
    first = rough.argmax(axis=1)
    rows = np.arange(len(begin))
    low, high = t[rows, first], t[rows, first + TAIL]
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
    reach = np.maximum(STENCIL / 2 * span, SHORTEST * sample.period)
    below, above = np.minimum(reach, low - part.floor), np.minimum(reach, part.roof - high)
    inner = low[:, None] + span[:, None] * np.arange(1, 2 * STENCIL) / (2 * STENCIL)
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
