"""Chebyshev panels of a coefficient: fitted, cut where it is not smooth, checked off the nodes, and joined.

Places where a coefficient is not smooth are found by bisection between the polynomials on their two sides.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from flexlin.checks import Array, check_size
from flexlin.errors import UnresolvedCoefficient
from flexlin.periodic.coefficient_series.matrix import Discontinuity, ResolvedMatrix
from flexlin.periodic.coefficient_series.sampling import (
    JUMP_WIDTH,
    LEAST_SIZE,
    NOISE_DEVIATIONS,
    POINTS,
    SEARCH_BLOCKS,
    Sampler,
    end_phases,
    graded,
    look_beyond,
    need_repeatability,
    need_repetition,
    noise_level,
    search_phases,
    stratified,
)
from flexlin.periodic.interpolation import (
    NAMED_PARTS,
    NODES,
    TAIL,
    ChebyshevPanels,
    chebyshev_coefficients,
    chebyshev_nodes,
    chebyshev_transform,
    divided,
    panel_times,
)
from flexlin.precision import EPS, SAFETY

MOST_PANELS = SEARCH_BLOCKS * NODES
"""The largest number of panels."""
STENCIL = NODES // TAIL
"""Nodes of the polynomial on either side of a place, which is as long as half as many brackets."""
NARROWEST_PANEL = EPS * NODES * NODES
"""Width, of the period, below which a panel is not divided any more: the first of its nodes would not differ."""


@dataclass
class PanelSet:
    """Panels (Q,): edges, coefficients (Q, K, E), deviation of noise (Q, E), what was seen at check points, and whether any were.

    deviation, average, drift (Q, E): the largest size of A less the panel, its mean size, and the size of its mean.
    """

    begin: Array
    end: Array
    coefficients: Array
    noise: Array
    deviation: Array
    average: Array
    drift: Array
    checked: Array

    @property
    def width(self) -> Array:
        """Lengths in s."""
        return np.asarray(self.end - self.begin)

    def some(self, which: Array | slice) -> "PanelSet":
        """A part of the panels."""
        return PanelSet(*(getattr(self, field.name)[which] for field in fields(self)))

    def joined(self, other: "PanelSet") -> "PanelSet":
        """Both sets, in the order of time."""
        order = np.argsort(np.concatenate([self.begin, other.begin]))
        return PanelSet(*(np.concatenate([getattr(self, f.name), getattr(other, f.name)])[order] for f in fields(self)))

    def series(self) -> ChebyshevPanels:
        """The function of time that they make where they fill the period, (N,) -> (N, E)."""
        return ChebyshevPanels(np.append(self.begin, self.end[-1:]), self.coefficients)


def fitted(sample: Sampler, begin: Array, end: Array, noise: Array | None = None) -> PanelSet:
    """Sample panels and interpolate."""
    count, entries = len(begin), len(sample.scale)
    values = sample(panel_times(begin, end, NODES).ravel()).reshape(count, NODES, entries)
    noise = np.zeros((count, entries)) if noise is None else noise
    deviation, average, drift = np.zeros((3, count, entries))
    return PanelSet(begin, end, chebyshev_coefficients(values), noise, deviation, average, drift, np.zeros(count, bool))


def left_over(panels: PanelSet, sample: Sampler) -> Array:
    """What panels may leave over (Q, E): tol of each entry's size, its noise, and A' times the rounding of t."""
    low = np.abs(panels.coefficients[:, : NODES // 2])
    rate = np.einsum("k,qke->qe", np.arange(NODES // 2) ** 2.0, low) * 2 / panels.width[:, None]
    rounding = np.minimum(EPS * sample.period * rate, 1e-6 * sample.scale)
    return np.asarray(
        np.maximum(np.maximum(sample.tol * sample.scale + LEAST_SIZE, NOISE_DEVIATIONS * panels.noise), rounding)
    )


def panel_error(panels: PanelSet, degree: int) -> tuple[Array, Array]:
    """Bounds on the error of each entry on each panel (Q, E): of its size anywhere, and of its integral divided by the panel's length.

    By the deviations seen and the coefficients beyond `degree`. What is allowed plays no part: most panels agree far better. The mean
    size of the deviation counts beside its mean, for the times at which the panel is read, which are rounded as those of the samples.
    """
    size = np.abs(panels.coefficients)
    beyond, tails = size[:, degree + 1 :].sum(axis=1), size[:, -TAIL:].sum(axis=1)
    anywhere = SAFETY * panels.deviation + tails + beyond + EPS * size.sum(axis=1)
    return anywhere, panels.drift + panels.average + beyond


def shown_degree(panels: PanelSet, scale: Array) -> int:
    """The degree beyond which the coefficients are rounding or noise in every panel and entry, by the root of the sum of their squares."""
    floor = np.maximum(2 * EPS * scale + LEAST_SIZE, panels.noise)
    left = ((panels.coefficients[:, ::-1] / floor[:, None]) ** 2).cumsum(axis=1)[:, ::-1]
    return max(int(np.count_nonzero(np.any(left > 1, axis=(0, 2)))) - 1, 0)


def rough_edges(panels: PanelSet, sample: Sampler) -> tuple[Array, Array]:
    """Left edges at which A is not smooth (S,), 0 for the period's end, and whether it jumps there.

    A jump: the two sides differ by 8 times what is allowed. A kink: either side, continued by a 1 / 32^2 of the narrower panel, differs
    from the other by as much; a polynomial of degree 31 magnifies its rounding by cosh(31 arccosh(1 + 2 / 32^2)) = 3.5 then.
    """
    width, before = panels.width, np.roll(np.arange(len(panels.begin)), 1)
    step = np.minimum(width, width[before]) / NODES**2
    at = np.stack([np.zeros_like(step), step, -step], axis=1)
    here, there = chebvander(np.stack([2 * at / width[:, None] - 1, 2 * at / width[before][:, None] + 1]), NODES - 1)
    own, other = here @ panels.coefficients, there @ panels.coefficients[before]
    allowed = left_over(panels, sample)
    apart = (np.abs(own - other) / np.maximum(allowed, allowed[before])[:, None]).max(axis=2)
    which = np.flatnonzero(apart.max(axis=1) > 8)
    return panels.begin[which], apart[which, 0] > 8


def miss_beside(sample: Sampler, series: ChebyshevPanels, places: Array, looked_at: Array) -> Array:
    """Bound the integral of |A - series| within 1e-11 T of each place (B,), for each entry: (B, E); zero beside those not looked at.

        |A(t+) - A(t-)| d_0 / 2   +   sum over both sides and k of   (d_k - d_(k-1)) max(|A - series|(t +- d_k), |A - series|(t +- d_(k-1)))

    with d_0 the last bit of t. A jump that is off by d costs its height times d; a kink half of d^2 times the jump of its slope.
    """
    missed = np.zeros((len(places), series.coefficients[0, 0].size))
    which = np.isin(places, looked_at)
    edges = places[which]
    if not len(edges):
        return missed
    T = sample.period
    away = np.maximum(np.spacing(edges), EPS * T / 8)[:, None] * 2.0 ** np.arange(
        int(np.log2(8 * JUMP_WIDTH / EPS)) + 2
    )
    t = np.mod(edges[:, None, None] + away[:, None] * np.array([[-1.0], [1.0]]), T)
    apart = np.abs(sample(t.ravel()) - series(t.ravel()).reshape(t.size, -1)).reshape(*t.shape, -1)
    nearer = np.concatenate([apart[:, :, :1], apart[:, :, :-1]], axis=2)
    width = np.diff(away, axis=1, prepend=0.0)
    jump = np.abs(series(edges) - series(edges, left=True)).reshape(len(edges), -1)
    missed[which] = away[:, :1] / 2 * jump + np.einsum("bk,bske->be", width, np.maximum(apart, nearer))
    return missed


class PanelResolver:
    """The state of the refinement: the resolved panels.

    Parameters: named: breaks; checks: times in [0, T) at which panels are held against A; wary: whether to look for other jumps close to
    each edge.
    """

    done: PanelSet

    def __init__(self, sample: Sampler, named: Array, checks: Array, wary: bool):
        self.sample, self.checks = sample, checks
        self.named, self.wary = named, wary

    def run(self, edges: Array) -> PanelSet:
        """Refine panels between edges until nodes and check points agree.

        Raises: UnresolvedCoefficient.
        """
        todo = fitted(self.sample, edges[:-1], edges[1:])
        self.done = todo.some(slice(0))
        while len(todo.begin):
            while len(todo.begin):
                todo = self.refined(self.accept(todo))
            self.check()
            panels, self.done = self.done, self.done.some(slice(0))
            todo = self.refined(self.accept(panels))
        return self.done

    def accept(self, panels: PanelSet) -> PanelSet:
        """Keep panels whose last coefficients have vanished, and which are near A where it was looked at; return the others."""
        allowed = left_over(panels, self.sample)
        last = np.abs(panels.coefficients[:, -TAIL:]).max(axis=1)
        good = np.all((last <= allowed / 4) & (panels.deviation <= 2 * allowed), axis=1)
        self.done = self.done.joined(panels.some(good))
        return panels.some(~good)

    def refined(self, panels: PanelSet) -> PanelSet:
        """Accept panels that are at their noise; cut the others where they are not smooth, or in the middle."""
        if not len(panels.begin):
            return panels
        panels.noise = np.maximum(panels.noise, noise_level(self.sample, panels.begin, panels.end))
        panels = self.accept(panels)
        if not len(panels.begin):
            return panels
        self.need_room(panels)
        cuts = self.cuts(panels)
        begin = np.stack([panels.begin, cuts], axis=1).ravel()
        end = np.stack([cuts, panels.end], axis=1).ravel()
        return fitted(self.sample, begin, end, np.repeat(panels.noise, 2, axis=0))

    def cuts(self, panels: PanelSet) -> Array:
        """One place inside each panel (Q,)."""
        width = panels.width
        middle = panels.begin + width / 2
        allowed = left_over(panels, self.sample)
        brackets, useful = scan(self.sample, panels.begin, panels.end, allowed)
        which = np.flatnonzero(useful & (width > 10 * NARROWEST_PANEL * self.sample.period))
        place, last = locate(self.sample, brackets[:, which], allowed[which])
        sharp, off = last / width[which], np.abs(place - middle[which]) / width[which]
        margin = np.minimum(place - panels.begin[which], panels.end[which] - place)
        kept = ((sharp < 1e-4) | ((sharp < 1 / 300) & (off < 0.25))) & (margin > NARROWEST_PANEL * self.sample.period)
        middle[which[kept]] = place[kept]
        return middle

    def need_room(self, panels: PanelSet) -> None:
        """Refuse what needs panels that are too narrow or too many."""
        width = panels.width
        worst = int(width.argmin())
        count = len(self.done.begin) + 2 * len(width)
        if count > NAMED_PARTS:  # noise of its own would be cut to the last bit
            need_repeatability(self.sample, panels.begin + 0.38 * width)
        if width[worst] > NARROWEST_PANEL * self.sample.period and count <= MOST_PANELS:
            entries = len(self.sample.scale)
            check_size(
                f"A(t) on {count} panels", 8 * NODES * count * entries, "name jumps in `breaks`, pulses in `features`"
            )
            return
        middle = panels.begin[worst] + width[worst] / 2
        raise UnresolvedCoefficient(
            f"A(t) cannot be resolved near t = {middle:.15g} s",
            got=f"{count} panels, the narrowest {width[worst]:.3g} s wide",
            expected=f"at most {MOST_PANELS} panels, none below {NARROWEST_PANEL * self.sample.period:.3g} s",
            todo="look at A there: is it bounded? Name jumps in `breaks` and pulses in `features`",
        )

    def check(self) -> None:
        """Compare with A off the nodes where that has not been done."""
        panels = self.done
        t = self.check_times()
        owner = np.clip(np.searchsorted(panels.begin, t, side="right") - 1, 0, len(panels.begin) - 1)
        fresh = ~panels.checked[owner]
        t, owner = t[fresh], owner[fresh]
        left, share = self.sample(t) - panels.series()(t), shares(panels, t, owner)[:, None]
        first = np.flatnonzero(np.diff(owner, prepend=-1))
        held = owner[first]
        panels.drift[held] = np.abs(np.add.reduceat(share * left, first))
        np.abs(left, out=left)
        panels.average[held] = np.add.reduceat(share * left, first)
        panels.deviation[held] = np.maximum.reduceat(left, first)
        panels.checked[:] = True

    def check_times(self) -> Array:
        """The given check points, some in every panel, and some ever closer to each edge where A is not smooth."""
        panels, T = self.done, self.sample.period
        own = panels.begin[:, None] + panels.width[:, None] * stratified(NODES // 2, 0.5)
        rough = np.union1d(rough_edges(panels, self.sample)[0], self.named) if self.wary else self.named[:0]
        near = np.mod(graded(rough, JUMP_WIDTH * T, T / 64, np.pi), T)
        t = np.unique(np.concatenate([self.checks, own.ravel(), near]))
        return t[(t >= 0) & (t < T)]


def shares(panels: PanelSet, t: Array, owner: Array) -> Array:
    """The part of its panel for which each of increasing times (N,) stands: half-way to its neighbours, or to the panel's ends."""
    middle = (t[1:] + t[:-1]) / 2
    low = np.maximum(np.append(panels.begin[:1], middle)[: len(t)], panels.begin[owner])
    high = np.minimum(np.append(middle, panels.end[-1:])[: len(t)], panels.end[owner])
    return np.asarray((high - low) / panels.width[owner])


def resolve_on_panels(sample: Sampler, named: Array, pairs: Array, wary: bool, repeats: bool) -> ResolvedMatrix:
    """Resolve by panels, judge the period, and collect."""
    T = sample.period
    sample(T * stratified(POINTS))
    shape = sample.shape or (0, 0)
    about = [np.mod(centre + 4 * width * (2 * stratified(2 * NODES) - 1), T) for centre, width in pairs]
    phases = np.concatenate([search_phases(), end_phases()]) if wary else stratified(NAMED_PARTS)
    checks = np.unique(np.concatenate([T * phases, *about]))
    done = PanelResolver(sample, named, checks, wary).run(first_edges(T, named, pairs))
    rough, jumps = rough_edges(done, sample)
    found = tuple(
        Discontinuity(float(t), "jump" if jump else "kink")
        for t, jump in zip(rough, jumps, strict=True)
        if not np.any(np.abs(named - t) <= 4 * EPS * T)
    )
    allowed = left_over(done, sample).max(axis=0)
    degree = shown_degree(done, sample.scale)
    coefficients = done.coefficients[:, : degree + 1].reshape(len(done.begin), degree + 1, *shape)
    series = ChebyshevPanels(np.append(done.begin, T), coefficients)
    narrow = np.argsort(done.width)[:32]
    times = np.sort(done.begin[narrow] + 0.38 * done.width[narrow])
    if repeats:
        t = np.concatenate([times, T * stratified(POINTS)])
        need_repetition(sample, series(t).reshape(len(t), -1), look_beyond(sample, t + T), t, allowed, rough)
    anywhere, local = (bound.reshape(-1, *shape) for bound in panel_error(done, degree))
    located = np.array([place.time for place in found])
    places = np.union1d(named, located)
    beside = miss_beside(sample, series, places, places if wary else located).reshape(-1, *shape)
    return ResolvedMatrix(series, tuple(places.tolist()), found, anywhere.max(axis=0), sample.count, local, beside)


def first_edges(period: float, named: Array, pairs: Array) -> Array:
    """Return the first edges from 0 to T: breaks, a graded mesh about each feature, and as many nodes as for a Fourier series."""
    fixed = np.unique(np.concatenate([[0.0, period], named]))
    longest = period * NODES / SEARCH_BLOCKS
    meshes = [graded([centre], width, max(longest / 2, width), np.pi) for centre, width in pairs]
    free = np.sort(np.mod(np.concatenate([np.empty(0), *meshes]), period))
    free = free[np.diff(free, append=np.inf) > JUMP_WIDTH * period]
    free = free[np.abs(free[:, None] - fixed).min(axis=1) > JUMP_WIDTH * period]
    return divided(np.union1d(fixed, free), longest)


def scan(sample: Sampler, begin: Array, end: Array, allowed: Array) -> tuple[Array, Array]:
    """Bracket the roughest window of each panel by its fourth difference; and whether there is room for stencils beside it (P,).

    Brackets: intervals (low, high), each with a place where A is not smooth, inside rooms (floor, roof) where it is smooth otherwise:
    low, high, floor, roof (4, P).
    """
    width = end - begin
    t = begin[:, None] + width[:, None] * (np.arange(2 * NODES) + 0.5) / (2 * NODES)
    values = sample(t.ravel()).reshape(len(begin), 2 * NODES, -1)
    rough = (np.abs(np.diff(values, TAIL, axis=1)) / allowed[:, None]).max(axis=2)
    first = rough.argmax(axis=1)
    rows = np.arange(len(begin))
    low, high = t[rows, first], t[rows, first + TAIL]
    room = np.minimum(low - begin, end - high) >= (high - low) / 2
    return np.array([low, high, begin, end]), room & (rough[rows, first] > 1)


def locate(sample: Sampler, brackets: Array, allowed: Array) -> tuple[Array, Array]:
    """Narrow brackets (4, Q) until the two sides agree to `allowed` (Q, E) across them, or they end at neighbouring floats.

    p_- and p_+ interpolate A on stencils below and above the bracket. Among the parts of the bracket the cut s is taken at which

        sum_(i < s) |A - p_-|(x_i) + sum_(i >= s) |A - p_+|(x_i)

    is least, so a jump is followed to the last bit, and a kink until it no longer shows. A function that is smooth ends early.
    Returns: the first time of the upper side (Q,) and the width of the last bracket (Q,).
    """
    place, width = brackets[1].copy(), brackets[1] - brackets[0]
    open_ = np.arange(len(place))
    while len(open_):
        part = brackets[:, open_]
        cut, apart = _cut(sample, part, allowed[open_])
        brackets[:2, open_] = cut
        width[open_] = cut[1] - cut[0]
        narrow = width[open_] <= 1.01 * np.spacing(np.abs(cut[1]))
        stuck = width[open_] >= part[1] - part[0]
        done = narrow | stuck | ~apart
        place[open_] = np.where(narrow | apart, cut[1], (cut[0] + cut[1]) / 2)
        open_ = open_[~done]
    return place, width


def _cut(sample: Sampler, part: Array, allowed: Array) -> tuple[tuple[Array, Array], Array]:
    """One step: the new brackets, and whether the sides were still apart across the old ones."""
    low, high, floor, roof = part
    span = high - low
    reach = np.maximum(STENCIL / 2 * span, JUMP_WIDTH * sample.period)
    below, above = np.minimum(reach, low - floor), np.minimum(reach, roof - high)
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
    growth = chebvander(1 + 2 * span / np.minimum(below, above), STENCIL - 1)[:, -1]
    apart = np.abs(before - after).max(axis=(1, 2)) > 4 + 0.02 * growth
    return (line[rows, s], line[rows, s + 1]), apart


def _extrapolated(values: Array, u: Array) -> Array:
    """The interpolants of values (Q, STENCIL, E) at u (Q, L): (Q, L, E)."""
    return chebvander(u, STENCIL - 1) @ (chebyshev_transform(STENCIL) @ values)
