"""The refinement of panels over a period: divided, cut where the coefficient is not smooth, checked off the nodes."""

from itertools import pairwise

import numpy as np

from flexlin.checks import Array
from flexlin.errors import UnresolvedCoefficient
from flexlin.periodic.resolved.locate import Brackets, locate, scan
from flexlin.periodic.resolved.noise import noise_level
from flexlin.periodic.resolved.panels import EPS, NODES, TAIL, PanelSet, fitted, groups, left_over, rough_edges
from flexlin.periodic.resolved.repetition import need_repeatability
from flexlin.periodic.resolved.sampling import CheckPoints, Sampler, graded, stratified

NARROWEST = 1e-13
"""Width, of the period, below which a panel is not divided any more."""
MEMORY, MOST_PANELS = 10**8, 4096
"""Bytes that the coefficients may take, and the largest number of panels."""
MANY_PANELS = 200
"""Panels from which on it is asked whether A gives the same values twice: noise of its own would be cut to the last bit."""
OWN_CHECKS, WITNESSES = 17, 4
"""Check points that every panel gets, and how many failed ones a panel remembers."""


class PanelResolver:
    """The state of the refinement: resolved panels, the edges found, and the check points that once failed.

    Parameters: edges to start from; named: the breaks among them; wary: whether to look for other jumps close to each edge.
    """

    def __init__(self, sample: Sampler, tol: float, edges: Array, named: Array, checks: CheckPoints, wary: bool):
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
        for part in groups(len(panels.begin), len(self.sample.scale)):
            measured = noise_level(self.sample, panels.begin[part], panels.end[part])
            panels.noise[part] = np.maximum(panels.noise[part], measured)
        good = self.resolved(panels)
        self.done = self.done.joined(panels.some(good))
        panels = panels.some(~good)
        if not len(panels.begin):
            return panels
        self.need_room(panels)
        parts = groups(len(panels.begin), len(self.sample.scale))
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
        if count > MANY_PANELS:
            need_repeatability(self.sample, panels.begin + 0.38 * width)
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
            some, stands, values = t[part], share[part], self.checks.values(t[part])
            starts = np.flatnonzero(np.diff(owner[part], prepend=-1))
            for a, b in pairwise([*starts.tolist(), len(some)]):
                panel = int(owner[part][a])
                apart = panels.compare(panel, some[a:b], values[a:b], stands[a:b], allowed[panel])
                keep = a + np.argsort(-apart, kind="stable")[:WITNESSES][: np.count_nonzero(apart > 1)]
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
        own = panels.begin[:, None] + panels.width[:, None] * stratified(OWN_CHECKS, 0.5)
        rough = np.union1d(self.rough()[0], self.named) if self.wary else self.named[:0]
        near = np.mod(graded(rough, 1e-11 * T, T / 64, np.pi), T)
        t = np.unique(np.concatenate([self.checks.t, own.ravel(), near]))
        return t[(t >= 0) & (t < T)]


def shares(panels: PanelSet, t: Array, owner: Array) -> Array:
    """The part of its panel for which each of increasing times (N,) stands: half-way to its neighbours, or to the panel's ends."""
    middle = (t[1:] + t[:-1]) / 2
    low = np.maximum(np.append(panels.begin[:1], middle)[: len(t)], panels.begin[owner])
    high = np.minimum(np.append(middle, panels.end[-1:])[: len(t)], panels.end[owner])
    return np.asarray((high - low) / panels.width[owner])
