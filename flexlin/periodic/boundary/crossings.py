"""All values of one parameter at which a periodic system becomes unstable or stable again: scans along one line or many."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.spectra import (
    SCAN_SHARE,
    Effort,
    Spectra,
    SpectraFunction,
    count_resting,
    drop_resting,
    measure_margins,
    measure_meetings,
)
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.roots import MOST_STEPS, SignedEnds, solve_brackets
from flexlin.precision import MINOR, PARTIAL, ROOT_EPS, SAFETY, SLIGHT, TINY

SCAN_VALUES = 1025
"""Values of the scan: no interval of instability wider than 1/1024 of the range lies between two of them."""
COARSE_CELLS, CELLS = 8, 32
"""Cells of a scan at the least, of one with the time for it, and of a lattice on either side."""
DECAY_REACH = 2.0
"""A pair whose decay over a period exceeds its motion across a cell by this factor is not lifted to growth inside the cell alone."""
LINE_HALVINGS = 4
"""How often, at the most, cells of a lattice's lines are halved."""
UNLIKE_ANGLES = 0.5
"""Angles of multipliers that differ by more belong to different tongues."""

LinesFunction = Callable[[Array, Array], Spectra]
"""Lines (W,) and values (W,) along them -> spectra."""


@dataclass(frozen=True)
class Crossing:
    """A value at which the verdict changes, with its error; `inside` is an unstable value nearby.

    slope: of the margin (growth over a period, or D where `undamped`) by the parameter; `touching`: the whole interval of instability
    is too narrow to be resolved; then value and error hold all of it.
    """

    value: float
    error: float
    onset: bool
    inside: float
    slope: float
    undamped: bool
    touching: bool = False


@dataclass(frozen=True)
class Scan:
    """Spectra at values (V,) along lines (V,), line by line and in rising order along each; `at` computes more of them."""

    line: Array
    values: Array
    spectra: Spectra
    at: LinesFunction

    @property
    def joined(self) -> Array:
        """Which values lie on one line with the next, (V - 1,)."""
        return self.line[1:] == self.line[:-1]

    def with_values(self, line: Array, values: Array) -> "Scan":
        """The scan with further values in their places."""
        if not len(values):
            return self
        line, values = np.unique(np.stack([line.astype(float), values]), axis=1)
        line = line.astype(int)
        lines, every = np.concatenate([self.line, line]), np.concatenate([self.values, values])
        order = np.lexsort((every, lines))
        spectra = self.spectra.beside(self.at(line, values)).at(order)
        return Scan(lines[order], every[order], spectra, self.at)


@dataclass(frozen=True)
class Peaks:
    """Highest places of functions between two neighbours (V,): line and value, and whether it is unstable there.

    gap: distance of the logs of the two multipliers that meet, as small as it gets; bend: -D''/2 there, >= 0; conjugate: whether
    a multiplier meets its own conjugate, at angle 0 or pi; error: of the logs there.
    """

    line: Array
    values: Array
    unstable: Array
    gap: Array
    bend: Array
    conjugate: Array
    error: Array


@dataclass(frozen=True)
class Changes:
    """Changes of the verdict on lines (V,): margins at the quiet and at the unstable end, a place between the two neighbours among whose
    cells the verdict changes, angle of the growing multiplier, kind of margin."""

    line: Array
    ends: SignedEnds
    between: Array
    angles: Array
    undamped: Array

    @property
    def rising(self) -> Array:
        """Where the unstable end stands behind the quiet one, (V,)."""
        return np.asarray(self.ends.points[1] > self.ends.points[0])


def find_crossings(
    rough: SpectraFunction,
    fine: SpectraFunction,
    low: float,
    high: float,
    tol: float,
    samples: int = SCAN_VALUES,
    narrow: bool = True,
    effort: Effort | None = None,
) -> list[Crossing]:
    """Every value between low and high at which the largest growth passes zero, in rising order.

    A scan of `samples` values, those left out between which the verdict cannot change (`settles`), finds every interval of instability
    wider than its step; what is narrower is looked for where multipliers meet between two values. Each change of verdict is then narrowed
    to tol / 4 by a function that is smooth through the boundary.

    Parameters: rough, fine: values (V,) -> spectra, cheap and as accurate as can be; tol: wanted error of a value;
    narrow: whether to look for tongues between two values; not where A does not depend on time, and multipliers meet without effect;
    effort: ends the search; places that are not narrowed by then have the width of their cells as their errors.
    """
    effort = effort or Effort()
    rough, fine = effort.timed(rough), effort.timed(fine)
    points, spectra = scan_line(rough, np.linspace(low, high, samples), effort)
    resting, touching = count_resting(spectra), list[Crossing]()
    if resting == spectra.logs.shape[1]:
        return []

    def without_rest(function: SpectraFunction) -> LinesFunction:
        return lambda _, values: drop_resting(function(values), resting)

    scan = Scan(np.zeros(len(points), dtype=int), points, drop_resting(spectra, resting), without_rest(rough))
    if narrow and not effort.gap:
        accuracy = max(tol / 4, ROOT_EPS**1.5 * (high - low))
        scan, peaks = add_tongues(scan, accuracy, effort)
        touching = list_touching(peaks, scan.spectra)
    changes = list_changes(scan)
    if not len(changes.line):
        return touching
    near = max(tol / 4, ROOT_EPS * (high - low))
    values, errors, slopes = solve_changes(changes, scan.at, near, effort)
    if effort.affords(4 * len(changes.line)) and not effort.unfinished:  # what the last digits of a place take
        finest = max(tol / 4, 2 * float(np.spacing(np.abs(values)).max()))
        values, errors, slopes = solve_changes(changes, without_rest(fine), finest, effort, values, 4 * near)
    else:
        effort.unfinished = True
    columns = values, errors, changes.rising, changes.ends.points[1], slopes, changes.undamped
    found = (Crossing(*row) for row in zip(*(one.tolist() for one in columns), strict=True))
    return sorted([*found, *touching], key=lambda one: (one.value, not one.onset))


def scan_line(function: SpectraFunction, grid: Array, effort: Effort) -> tuple[Array, Spectra]:
    """Values of a rising grid and spectra there: all where a verdict could change, and fewer elsewhere, COARSE_CELLS cells at the least.

    A cell is divided unless `settles` says that its verdict is one, however multipliers turn in it where it is one of fewer than CELLS;
    these are divided at last, where time does. Where it does not do for all, a part of it goes to those nearest to what is asked about
    each time, so that these are settled first; a change may hide in the others, and in the narrowest that are not.
    """
    last = len(grid) - 1
    chosen = np.array([0, last])
    found = function(grid[chosen])
    while True:
        if len(chosen) > last:
            return grid, found
        settled, widths = settles(found), np.diff(chosen)
        wide, widest = (widths > max(1, last // cells) for cells in (CELLS, COARSE_CELLS))
        sure = settled & ~widest & (~wide | settles(found, turning=True))
        share = SCAN_SHARE if np.ptp(found.verdicts) else (1 + SCAN_SHARE) / 2
        count, open_ = effort.count(share), np.flatnonzero((widths > 1) & ~sure)
        if not len(open_) and wide.sum() <= count:
            open_ = np.flatnonzero(wide)
        if not len(open_):
            return grid[chosen], found
        ends = np.stack([grid[chosen[:-1]], grid[chosen[1:]]])
        if count < 1:
            settled[open_] = False
            effort.leave(*ends[:, ~settled])
            return grid[chosen], found
        nearest = np.argsort(np.abs(ends[:, open_].mean(axis=0) - effort.about), kind="stable")
        open_ = open_[nearest[: int(min(np.ceil(PARTIAL * count), len(open_)))]]
        middles = (chosen[open_] + chosen[open_ + 1]) // 2
        chosen = np.concatenate([chosen, middles])
        order = np.argsort(chosen)
        chosen, found = chosen[order], found.beside(function(grid[middles])).at(order)


def list_touching(peaks: Peaks, scan: Spectra) -> list[Crossing]:
    """Tongues closed to within rounding: an undamped multiplier meets its conjugate and no growth is seen, there or beside it."""
    closed = (
        peaks.conjugate & ~peaks.unstable & (peaks.bend > 0) & (peaks.gap <= SAFETY * np.maximum(peaks.error, ROOT_EPS))
    )
    if (scan.verdicts < 0).any():
        return []
    found = np.flatnonzero(closed)
    errors = SAFETY * np.maximum(peaks.gap, peaks.error)[found] / np.sqrt(peaks.bend[found])
    return [
        Crossing(value, error, onset, value, 0.0, True, True)
        for value, error in zip(peaks.values[found].tolist(), errors.tolist(), strict=True)
        for onset in (True, False)
    ]


def settles(scan: Spectra, turning: bool = False) -> Array:
    """Between which neighbours of a scan (V,) the verdict cannot change, (V - 1,).

    Where both are stable: every log of a multiplier is further from the axis than it moves across the cell, by the factor DECAY_REACH, as
    for peaks of a scan, and by MINOR, since one that decays less may meet others anywhere. Where both are unstable: one that grows is
    so. Where neither has an answer there is nothing to find.

    Parameters: turning: multipliers may have turned by any angle across a cell, which a wide one does not show.
    """
    verdicts, known = scan.verdicts, scan.known
    logs = np.where(known[:, None], scan.felt, 0.0)
    seen, turn = (logs.real + 0j, np.pi) if turning else (logs, 0.0)
    apart = np.hypot(measure_distances(seen[:-1].T, seen[1:].T), turn)  # (n, n, V - 1)
    there, back = DECAY_REACH * apart.min(axis=1).T, DECAY_REACH * apart.min(axis=0).T
    a, b = logs[:-1].real, logs[1:].real
    decays = np.all((-a > there + MINOR) & (-b > back + MINOR), axis=1)
    grows = np.any(a > there + MINOR, axis=1) & np.any(b > back + MINOR, axis=1)
    stable, unstable = (verdicts[1:] < 0) & (verdicts[:-1] < 0), (verdicts[1:] > 0) & (verdicts[:-1] > 0)
    return np.asarray((stable & decays) | (unstable & grows) | (~known[1:] & ~known[:-1]))


def add_tongues(scan: Scan, accuracy: float, effort: Effort) -> tuple[Scan, Peaks]:
    """The scan with further values in tongues between two of its own, and all peaks that were climbed; accuracy: of the place of a peak."""
    scan = scan.with_values(*list_ends(scan, settles(scan.spectra)))
    peaks = climb_peaks(scan, accuracy, settles(scan.spectra), effort)
    return scan.with_values(peaks.line[peaks.unstable], peaks.values[peaks.unstable]), peaks


def divide_unsettled(scan: Scan) -> Scan:
    """The scan with its unsettled cells halved, and again where multipliers turn so far that tongues inside may not show beside them."""
    cell = np.flatnonzero(scan.joined & ~settles(scan.spectra))
    for _ in range(LINE_HALVINGS):
        scan = scan.with_values(scan.line[cell], (scan.values[cell] + scan.values[cell + 1]) / 2)
        first = cell + np.arange(len(cell))
        first = first[turns_unevenly(*(scan.spectra.at(first + k).logs for k in range(3)))]
        halves = np.sort(np.concatenate([first, first + 1]))
        cell = halves[~settles(scan.spectra)[halves]]
    return scan


def turns_unevenly(left: Array, middle: Array, right: Array) -> Array:
    """Where logs (V, n) do not come half as far to the middle as to the right: they turned farther than both ends show."""
    near, far = (measure_distances(left.T, other.T).min(axis=1) for other in (middle, right))
    return np.asarray((np.abs(near - far / 2) > MINOR).any(axis=0))


def measure_heights(spectra: Spectra) -> Array:
    """Functions that peak where a tongue may hide, (V, J + 1): D of each pair of neighbours, and the largest growth."""
    meetings, _ = measure_meetings(spectra)
    return np.concatenate([meetings, spectra.logs.real.max(axis=1, keepdims=True)], axis=1)


def list_ends(scan: Scan, settled: Array) -> tuple[Array, Array]:
    """Line and value just inside both ends of each, where the cell is not settled: a height that rises there has its top in it."""
    first = np.flatnonzero(np.append(True, ~scan.joined))
    last = np.append(first[1:], len(scan.line)) - 1
    ends, beside = np.concatenate([first, last]), np.concatenate([first + 1, last - 1])
    open_ = ~settled[np.minimum(ends, beside)]
    return scan.line[ends[open_]], (scan.values[ends] + SLIGHT * (scan.values[beside] - scan.values[ends]))[open_]


def list_peaks(scan: Scan, heights: Array, settled: Array) -> tuple[Array, Array]:
    """Index and column of each inner maximum between quiet neighbours that could rise to growth, in a cell that is not settled."""
    quiet, open_ = scan.spectra.verdicts <= 0, scan.joined & ~settled
    inner = quiet[1:-1] & quiet[:-2] & quiet[2:] & scan.joined[1:] & scan.joined[:-1] & (open_[1:] | open_[:-1])
    before, here, after = heights[:-2], heights[1:-1], heights[2:]
    top = (here >= before) & (here >= after) & ((here > before) | (here > after))
    columns = np.broadcast_to(np.arange(heights.shape[1]), here.shape)
    may = may_grow(scan.spectra.at(np.arange(1, len(heights) - 1)), np.stack([before, here, after]), columns)
    index, column = np.nonzero(inner[:, None] & top & may)
    return index + 1, column


def may_grow(spectra: Spectra, heights: Array, column: Array) -> Array:
    """Whether what drops from spectra (V,) to its sides, heights (3, V, ...) of columns (V, ...), could rise as much again to growth."""
    drop = np.maximum(heights[1] - np.minimum(heights[0], heights[2]), 0.0)
    largest = spectra.logs.real.max(axis=1, keepdims=True)
    growth = np.concatenate([measure_meetings(spectra)[1], largest], axis=1)
    decay = -np.take_along_axis(growth, column.reshape(len(growth), -1), axis=1).reshape(column.shape)
    return np.asarray(decay <= DECAY_REACH * np.where(column < growth.shape[1] - 1, np.sqrt(drop), drop))


def climb_peaks(scan: Scan, accuracy: float, settled: Array, effort: Effort) -> Peaks:
    """Climb by parabolas through three values, until a system is unstable, two multipliers have met, or none can grow between the three.

    Source: Brent, Algorithms for Minimization without Derivatives (1973), ch. 5: successive parabolic interpolation.
    """
    heights = measure_heights(scan.spectra)
    index, column = list_peaks(scan, heights, settled)
    three, line = index + np.arange(-1, 2)[:, None], scan.line[index]
    x, f, error = scan.values[three], heights[three, column], widest_error(scan.spectra)[index]
    unstable, climbing = np.zeros(len(index), dtype=bool), np.ones(len(index), dtype=bool)
    bend, slow = np.maximum(-fit_parabola(x, f)[1], 0.0), np.zeros(len(index), dtype=bool)
    for _ in range(MOST_STEPS):
        which = np.flatnonzero(climbing)
        if not len(which):
            break
        if not effort.affords(len(which), (1 + SCAN_SHARE) / 2):
            effort.leave(x[:, which].min(axis=0), x[:, which].max(axis=0))
            break
        new, width = place_top(x[:, which], f[:, which], slow[which]), np.ptp(x[:, which], axis=0)
        found = scan.at(line[which], new)
        value = measure_heights(found)[np.arange(len(which)), column[which]]
        error[which], unstable[which] = widest_error(found), found.verdicts > 0
        moved = np.abs(new - x[1, which])
        x[:, which], f[:, which] = enclose_peak(x[:, which], f[:, which], new, value)
        slow[which] = ~slow[which] & (np.ptp(x[:, which], axis=0) > width / 2)
        x[1, which] = np.where(unstable[which], new, x[1, which])
        met = np.abs(f[1, which]) <= error[which] ** 2
        may = may_grow(found, f[:, which], column[which])
        climbing[which] = ~unstable[which] & (moved > accuracy) & ~met & may
    conjugate = (column == 0) | (column == heights.shape[1] - 2)
    return Peaks(line, x[1], unstable, 2 * np.sqrt(np.maximum(-f[1], 0.0)), bend, conjugate, error)


def widest_error(spectra: Spectra) -> Array:
    """The largest finite error of each spectrum, (V,)."""
    return np.asarray(np.max(np.where(np.isfinite(spectra.errors), spectra.errors, 0.0), axis=1))


def fit_parabola(x: Array, f: Array) -> tuple[Array, Array]:
    """Where the parabola through three points (3, V) has its extremum, not finite for a straight line; and its square's coefficient."""
    first, second = (f[1] - f[0]) / (x[1] - x[0]), (f[2] - f[1]) / (x[2] - x[1])
    bend = (second - first) / (x[2] - x[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(x[1] - (first + bend * (x[1] - x[0])) / (2 * bend)), np.asarray(bend)


def place_top(x: Array, f: Array, slow: Array) -> Array:
    """The top of the parabola through three points (3, V) about a peak; inside them, and off the middle one; by the golden section where
    the parabola was slow: where multipliers change partners heights jump."""
    left, right, top = x[1] - x[0], x[2] - x[1], fit_parabola(x, f)[0]
    golden = (3 - np.sqrt(5)) / 2
    wide = np.where(left > right, x[1] - golden * left, x[1] + golden * right)
    inside = np.isfinite(top) & (top > x[0]) & (top < x[2]) & (top != x[1]) & ~slow
    return np.where(inside, top, wide)


def enclose_peak(x: Array, f: Array, new: Array, value: Array) -> tuple[Array, Array]:
    """The three of four points (3, V) about the highest."""
    four, heights = np.concatenate([x, new[None]]), np.concatenate([f, value[None]])
    order = np.argsort(four, axis=0, kind="stable")
    four, heights = np.take_along_axis(four, order, axis=0), np.take_along_axis(heights, order, axis=0)
    rows = np.clip(heights.argmax(axis=0), 1, 2) + np.arange(-1, 2)[:, None]
    return np.take_along_axis(four, rows, axis=0), np.take_along_axis(heights, rows, axis=0)


def add_quiet_strips(scan: Scan, accuracy: float) -> Scan:
    """The scan with a quiet value between two unstable neighbours whose growing multipliers stand at unlike angles, where there is one.

    Zero of the squared growth, taken as positive where the growing multiplier stands nearer to the first one's angle; none where one
    tongue goes over into the next.
    """
    angle = np.abs(scan.spectra.lead.imag)
    unstable = scan.spectra.verdicts > 0
    index = np.flatnonzero(unstable[1:] & unstable[:-1] & scan.joined & (np.abs(np.diff(angle)) > UNLIKE_ANGLES))

    def signed(which: Array, values: Array) -> tuple[Array, Array]:
        found, cell = scan.at(scan.line[index[which]], values), index[which]
        place = np.abs(found.lead.imag)
        nearer = np.abs(place - angle[cell]) <= np.abs(place - angle[cell + 1])
        return np.where(found.verdicts > 0, np.where(nearer, 1.0, -1.0) * found.lead.real**2, 0.0), 0 * place

    start = SignedEnds.between(signed, scan.values[[index, index + 1]])
    place, size, _ = solve_brackets(signed, start, accuracy).best
    return scan.with_values(scan.line[index[size == 0]], place[size == 0])


def list_changes(scan: Scan) -> Changes:
    """The pairs of neighbours between which instability begins or ends; an undecided value beside a stable one is stepped over."""
    verdicts, known = scan.spectra.verdicts, scan.spectra.known
    edges = np.flatnonzero(scan.joined & ((verdicts[1:] > 0) != (verdicts[:-1] > 0)) & known[1:] & known[:-1])
    rising = verdicts[edges + 1] > 0
    quiet, unstable = np.where(rising, edges, edges + 1), np.where(rising, edges + 1, edges)
    stable, between = verdicts[quiet] < 0, (scan.values[edges] + scan.values[edges + 1]) / 2
    beyond = np.clip(quiet + np.where(rising, -1, 1), 0, len(verdicts) - 1)
    move = (verdicts[quiet] == 0) & (verdicts[beyond] < 0) & (scan.line[beyond] == scan.line[quiet])
    quiet, stable = np.where(move, beyond, quiet), stable | move
    angles = scan.spectra.lead.imag[unstable]
    margins = [measure_margins(scan.spectra.at(end), ~stable, angles) for end in (quiet, unstable)]
    ends = SignedEnds(scan.values[[quiet, unstable]], *map(np.array, zip(*margins, strict=True)))
    return Changes(scan.line[unstable], ends, between, angles, ~stable)


def solve_changes(
    found: Changes,
    at: LinesFunction,
    accuracy: float,
    effort: Effort,
    guess: Array | None = None,
    reach: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Narrow every change to `accuracy` by a function that is smooth through the boundary: its zeros, their errors, its slopes, (V,).

    The slope is the smaller one from the zero to both ends of a bracket, as a narrow tongue bends the margin inside.
    Parameters: guess, reach: zeros by cheaper spectra, and how far beside them the signs are asked for first.
    """

    def margin(which: Array, values: Array) -> tuple[Array, Array]:
        return measure_margins(at(found.line[which], values), found.undamped[which], found.angles[which])

    ends = found.ends
    if guess is not None:
        step = np.where(found.rising, 1, -1) * np.minimum(reach, np.abs(guess - ends.points).min(axis=0))
        near = SignedEnds.between(margin, np.array([guess - step, guess + step]))
        met = (near.values[0] < 0) & (near.values[1] > 0)
        ends = SignedEnds(
            *(np.where(met, *both) for both in zip(vars(near).values(), vars(ends).values(), strict=True))
        )
    unlike = np.array([np.minimum(ends.values[0], -TINY), np.maximum(ends.values[1], TINY)])
    narrow = solve_brackets(margin, replace(ends, values=unlike), accuracy, effort.affords)
    zero, left, unknown = narrow.best
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = ends.values / (ends.points - zero) * np.where(found.rising, 1, -1)
    slope = np.nanmin(np.where(slopes > 0, slopes, np.inf), axis=0)
    early = (narrow.width > accuracy) & (left > 0)
    effort.unfinished |= bool(early.any())
    wide = early | (zero == ends.points[1])  # beside the top of a tongue no slope is known
    error = np.minimum(np.where(wide, narrow.width, left / slope) + unknown / slope, found.ends.width)
    return zero, error + 2 * np.spacing(np.abs(zero)), slope
