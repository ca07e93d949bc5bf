"""All values of one parameter at which a periodic system becomes unstable or stable again."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.narrow import Peaks, find_peaks, list_end_peaks
from flexlin.periodic.boundary.roots import SignedEnds, solve_brackets
from flexlin.periodic.boundary.scan import scan_sparsely, settles
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction, count_resting, drop_resting, measure_margins

SAMPLES = 1025
"""Values of the scan: no interval of instability wider than 1/1024 of the range lies between two of them."""
NEAR = 2
"""Undecided values beside a boundary that belong to the crossing; more of them are a system without damping."""
ROUGH = 1e-9
"""Of the range: how far the brackets are narrowed before the accurate spectra take over."""
WIDER, TRIES = 16.0, 8
"""Factor and number of steps by which a bracket grows until the accurate spectra confirm its signs."""


@dataclass(frozen=True)
class Crossing:
    """A value at which the verdict changes, with its error; `inside` is an unstable value nearby.

    slope: of the margin (growth over a period, or D where `undamped`) by the parameter; width: of the whole interval of instability where
    that is too narrow to be resolved (`touching`): then value and error hold all of it.
    """

    value: float
    error: float
    onset: bool
    inside: float
    slope: float
    undamped: bool
    touching: bool = False


@dataclass(frozen=True)
class Intervals:
    """Neighbouring values (V,) with unlike verdicts: the quiet and the unstable end, angle of the growing multiplier, kind of margin."""

    quiet: Array
    unstable: Array
    angles: Array
    undamped: Array


def find_crossings(
    rough: SpectraFunction,
    fine: SpectraFunction,
    low: float,
    high: float,
    tol: float,
    samples: int = SAMPLES,
    narrow: bool = True,
    sparse: bool = False,
    first: SpectraFunction | None = None,
) -> list[Crossing]:
    """Every value between low and high at which the largest growth passes zero, in rising order.

    A scan of `samples` values finds every interval of instability wider than its step; what is narrower is looked for where multipliers
    meet between two values. Each change of verdict is then narrowed to tol / 4 by a function that is smooth through the boundary.

    Parameters: rough, fine: values (V,) -> spectra, cheap and as accurate as can be; tol: wanted error of a value;
    narrow: whether to look for tongues between two values; not where A does not depend on time, and multipliers meet without effect;
    sparse: whether to leave out values between which the verdict cannot change (`scan_sparsely`); first: values -> spectra of the scan,
    where its verdicts need not come from `rough`.
    """
    first = first or rough
    if sparse:
        points, scan = scan_sparsely(first, low, high, samples)
    else:
        points = np.linspace(low, high, samples)
        scan = first(points)
    resting = count_resting(scan)
    if resting == scan.logs.shape[1]:
        return []

    def moving(values: Array) -> Spectra:
        return drop_resting(rough(values), resting)

    def moving_fine(values: Array) -> Spectra:
        return drop_resting(fine(values), resting)

    scan, touching = drop_resting(scan, resting), list[Crossing]()
    if narrow:
        settled = settles(scan) if sparse else np.zeros(len(points) - 1, dtype=bool)
        if not (settled[0] and settled[-1]):
            points, scan = merge_scans(points, scan, list_end_peaks(points, scan), moving)
            settled = settles(scan) if sparse else np.zeros(len(points) - 1, dtype=bool)
        peaks = find_peaks(points, scan, moving, max(tol / 4, 1e-13 * (high - low)), settled)
        points, scan = merge_scans(points, scan, np.unique(peaks.points[peaks.unstable]), moving)
        touching = list_touching(peaks, scan)
    crossings = locate_crossings(list_intervals(points, scan), moving, moving_fine, tol, high - low)
    return sorted([*crossings, *touching], key=lambda one: (one.value, not one.onset))


def merge_scans(points: Array, scan: Spectra, more: Array, function: SpectraFunction) -> tuple[Array, Spectra]:
    """The scan with further values in their places."""
    if not len(more):
        return points, scan
    extra = function(more)
    together = np.concatenate([points, more])
    order = np.argsort(together, kind="stable")
    logs, errors = np.concatenate([scan.logs, extra.logs]), np.concatenate([scan.errors, extra.errors])
    return together[order], Spectra(logs[order], errors[order])


def list_intervals(points: Array, scan: Spectra) -> Intervals:
    """The pairs of neighbours between which instability begins or ends; undecided values beside a stable one are stepped over."""
    verdicts = scan.verdicts
    known = scan.known
    edges = np.flatnonzero(((verdicts[1:] > 0) != (verdicts[:-1] > 0)) & known[1:] & known[:-1])
    rising = verdicts[edges + 1] > 0
    quiet, unstable, step = (
        np.where(rising, edges, edges + 1),
        np.where(rising, edges + 1, edges),
        np.where(rising, -1, 1),
    )
    stable = verdicts[quiet] < 0
    for _ in range(NEAR):
        beyond = np.clip(quiet + step, 0, len(points) - 1)
        move = ~stable & (verdicts[quiet] == 0) & (verdicts[beyond] < 0)
        quiet, stable = np.where(move, beyond, quiet), stable | move
    rows = np.arange(len(points))
    angles = scan.logs.imag[rows, scan.leading][unstable]
    return Intervals(points[quiet], points[unstable], angles, ~stable)


def locate_crossings(
    found: Intervals, rough: SpectraFunction, fine: SpectraFunction, tol: float, span: float
) -> list[Crossing]:
    """Narrow every interval, first by cheap spectra, then by accurate ones."""
    if not len(found.quiet):
        return []

    def margin(function: SpectraFunction, which: Array, values: Array) -> tuple[Array, Array]:
        return measure_margins(function(values), found.undamped[which], found.angles[which])

    every = np.arange(len(found.quiet))
    start = SignedEnds(
        found.quiet, found.unstable, margin(rough, every, found.quiet)[0], margin(rough, every, found.unstable)[0]
    )
    near = solve_brackets(lambda which, x: margin(rough, which, x)[0], start, max(tol / 4, ROUGH * span))
    wide = confirm_brackets(lambda which, x: margin(fine, which, x)[0], near, found, max(tol, 10 * ROUGH * span))
    narrow = solve_brackets(lambda which, x: margin(fine, which, x)[0], wide, tol / 4)
    value = narrow.best
    slope = measure_slopes(wide, value)
    at_value, uncertain = margin(fine, every, value)
    error = np.minimum((np.abs(at_value) + uncertain) / slope, np.abs(found.unstable - found.quiet)) + 4e-16 * np.abs(
        value
    )
    rows = zip(value, error, found.unstable > found.quiet, found.unstable, slope, found.undamped, strict=True)
    return [
        Crossing(float(at), float(wrong), bool(onset), float(inside), float(steep), bool(undamped))
        for at, wrong, onset, inside, steep, undamped in rows
    ]


def measure_slopes(wide: SignedEnds, value: Array) -> Array:
    """The smaller of the slopes from a zero to both ends of its bracket: a narrow tongue bends the margin inside the bracket."""
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.abs([wide.at_a / (wide.a - value), wide.at_b / (wide.b - value)])
    return np.asarray(np.nanmin(np.where(slopes > 0, slopes, np.inf), axis=0))


def confirm_brackets(
    function: Callable[[Array, Array], Array], near: SignedEnds, found: Intervals, reach: float
) -> SignedEnds:
    """SignedEnds about those that cheap spectra found, whose signs the accurate spectra confirm; as wide as need be."""
    centre, way = near.best, np.sign(found.unstable - found.quiet)
    ends = []
    for end, sign in ((found.quiet, -1.0), (found.unstable, 1.0)):
        size, place = np.full(centre.shape, reach), centre.copy()
        value, growing = np.zeros(centre.shape), np.ones(centre.shape, dtype=bool)
        for _ in range(TRIES):
            which = np.flatnonzero(growing)
            if not len(which):
                break
            step = np.minimum(size[which], np.abs(end - centre)[which])
            place[which] = centre[which] + sign * way[which] * step
            value[which] = function(which, place[which])
            growing[which] = (np.sign(value[which]) != sign) & (step < np.abs(end - centre)[which])
            size *= WIDER
        ends.append((place, value))
    (a, at_a), (b, at_b) = ends
    return SignedEnds(a, b, at_a, at_b)


def list_touching(peaks: Peaks, scan: Spectra) -> list[Crossing]:
    """Tongues closed to within rounding: an undamped multiplier meets its conjugate and no growth is seen."""
    undamped = (scan.verdicts >= 0).all()
    crossings = []
    for i in np.flatnonzero(peaks.conjugate & ~peaks.unstable & (peaks.bend > 0)) if undamped else ():
        floor = 4 * max(float(peaks.error[i]), 1e-8)
        if peaks.gap[i] <= floor:
            value, error = (
                float(peaks.points[i]),
                max(float(peaks.gap[i]), float(peaks.error[i])) / np.sqrt(peaks.bend[i]),
            )
            for onset in (True, False):
                crossings.append(Crossing(value, float(error), onset, value, 0.0, True, True))
    return crossings
