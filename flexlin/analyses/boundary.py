"""Where a loop becomes unstable or stable again: values of one number, how far the scene's own is from them, and curves in two numbers."""

from contextlib import suppress
from dataclasses import replace
from math import inf

import numpy as np

from flexlin.analyses.spectra import LOOSE_LOG_ERROR, SCAN_ERROR, Family, Ranges, Source, make_family
from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array, whole
from flexlin.errors import ArgumentError, counted
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.boundary.crossings import CELLS, SCAN_VALUES, Crossing, find_crossings
from flexlin.periodic.boundary.curves import find_curves, find_lost_ends
from flexlin.periodic.boundary.spectra import Effort
from flexlin.periodic.circle import assign, measure_distances
from flexlin.periodic.floquet.exponents import floquet
from flexlin.precision import MINOR
from flexlin.scene.parameters import get_value, need_numbers
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

SPECTRA_PER_VALUE = 6
"""Spectra that take as long as the resonance and the slope at a value."""


@immutable
class CriticalValue:
    """A value of a number at which a loop becomes unstable, or stable again.

    Attributes
    ----------
    path : str
        Dotted path of the number.
    value : float
        The critical value, in the number's unit.
    error : float
        Its error: that of the exponent over the slope of the growth rate; of the multipliers' squared distance over its slope where
        two of them meet without damping. Where `touching`, it holds the whole closed tongue.
    kind : str
        onset where the loop is unstable above the value, recovery where it is unstable below.
    resonance : str
        What makes it unstable, in words.
    distance : float
        The value less the scene's own, in the number's unit; not a number where there is no scene.
    slope : float
        Of the largest growth rate at the value, in 1/s per unit; infinite where two undamped multipliers meet, since growth then begins
        like a square root, and zero where a tongue only touches.
    touching : bool
        Whether onset and recovery are so close that rounding hides what lies between them.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("spinning-link", {"effects.gravity.acceleration": 3.0})
    >>> first, second = fl.critical_values(scene, "motion.joints.0.rate", (2.3, 2.6), samples=65)
    >>> first.kind, round(first.value, 6), second.kind, round(second.value, 6)
    ('onset', 2.418547, 'recovery', 2.436804)
    >>> first.resonance
    'principal resonance of order 3: 2 x 3.674 rad/s near 3 w, w = 2.422 rad/s = 2 pi / T'
    """

    path: str
    value: float
    error: float
    kind: str
    resonance: str
    distance: float
    slope: float
    touching: bool = False


@checked
def critical_values(
    source: Source,
    path: str,
    limits: tuple[float, float],
    tol: float = 1e-6,
    *,
    loop: str = "own",
    samples: int = SCAN_VALUES,
) -> list[CriticalValue]:
    """Find every value of a number, within limits, at which a loop becomes unstable or stable again.

        max_i Re lambda_i(p) = 0,   error of p = error of lambda / |d Re lambda / dp|

    The range is scanned at `samples` values, those left out between which exponents decay by more than they move, so no interval of
    instability wider than one step is missed; narrower ones are looked for where two multipliers meet. Without damping the growth rate
    begins like a square root; the squared distance of the two multipliers that meet is smooth
    there and takes its place. Free rigid motions, whose exponents are zero throughout, do not count. Transition matrices of a function's
    systems are interpolated over the range, where values between show that this serves; critical values are narrowed without it.

    Parameters
    ----------
    source : Scene, PeriodicFamily, or function of a float that returns a PeriodicSystem
        The scene; or the systems themselves, where there is no scene. A family's go through compiled code together.
    path : str
        Dotted path of the number, such as motion.frequency; for a family or a function, the number's name.
    limits : (float, float)
        Least and largest value, in the number's unit.
    tol : float
        Wanted error of a critical value, in the number's unit.
    loop : str
        Which loop of the scene, as in `sweep`: own, open, a design's name, or that name followed by ", redone".
    samples : int
        Values of the scan: one more than the steps of the range.

    Returns
    -------
    list of CriticalValue
        In rising order; empty where the verdict does not change.

    Raises
    ------
    ArgumentError
        For a path that leads to no free number, limits that do not rise, or an unknown loop.
    SceneError
        For limits that the scene's schema refuses.
    ModelError
        For ranges in which the equations break, as where M is indefinite.

    References
    ----------
    Seyranian, Mailybaev, Multiparameter Stability Theory with Mechanical Applications (2003), ch. 9 and 11.

    Examples
    --------
    Mathieu's equation y'' + (a - 0.4 cos 2t) y = 0 is unstable between a = 0.795 and a = 1.195:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> def mathieu(a):
    ...     return fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], lambda t: (a - 0.4 * np.cos(2 * t))[:, None, None], np.pi)
    >>> found = fl.critical_values(mathieu, "a", (0.5, 1.5), samples=33)
    >>> [(one.kind, round(one.value, 6)) for one in found]
    [('onset', 0.795124), ('recovery', 1.194874)]
    """
    limits = check_limits(path, limits)
    family = make_family(source, {path: limits}, loop)
    return search_family(family, path, limits, positive("tol", tol), whole("samples", samples, 3), Effort())


def search_family(
    family: Family, path: str, limits: tuple[float, float], tol: float, samples: int, effort: Effort
) -> list[CriticalValue]:
    """The critical values of the one number of a family; effort: ends the search, with what is known by then."""
    rough, fine = (lambda values, find=find: find(values[:, None]) for find in (family.rough, family.fine))
    tongues = not family.is_constant(np.array([sum(limits) / 2]))
    found = find_crossings(rough, fine, *limits, tol, samples, tongues, effort)
    nearest_first = sorted(found, key=lambda one: abs(one.value - float(np.nan_to_num(family.own[0]))))
    described = [describe_crossing(path, crossing, family, effort) for crossing in nearest_first]
    return sorted(described, key=lambda one: (one.value, one.kind != "onset"))


def check_limits(path: str, limits: tuple[float, float]) -> tuple[float, float]:
    """Both ends of a range as floats. Raises: ArgumentError unless they rise."""
    low, high = real_array(f"limits of {path}", limits, (2,)).tolist()
    if not low < high:
        raise ArgumentError(f"the limits of {path} do not rise", got=f"({low:g}, {high:g})", expected="low < high")
    return low, high


def describe_crossing(path: str, crossing: Crossing, family: Family, effort: Effort) -> CriticalValue:
    """A crossing with its resonance, its distance from the scene's own value, and its slope, as far as the effort affords them."""
    kind, distance = "onset" if crossing.onset else "recovery", crossing.value - float(family.own[0])
    found = CriticalValue(path, crossing.value, crossing.error, kind, "not looked for", distance, np.nan)
    if crossing.touching:
        text = f"touching tongue: closed to within rounding, narrower than {2 * crossing.error:.1e}"
        return replace(found, resonance=text, slope=0.0, touching=True)
    if not effort.affords(SPECTRA_PER_VALUE):
        effort.unfinished = True
        return found
    found = replace(found, resonance=describe_causes(family, np.array([crossing.inside])), slope=np.inf)
    return found if crossing.undamped else add_slope(found, family)


def add_slope(found: CriticalValue, family: Family) -> CriticalValue:
    """The slope of the growth rate, by a difference of the exponents about the value, and the error by it."""
    most = MINOR * abs(found.value) or inf  # the number keeps its sign
    step = min(max(1e-5 * abs(found.value), 10 * found.error), most)
    places = found.value + step * np.array([[0.0], [-1.0], [1.0]])
    here, *beside = (floquet(family.system_at(place), family.finest) for place in places)
    logs, size = here.log_multipliers, np.abs(here.exponents.real) + here.errors
    below, above = (one.exponents[assign(measure_distances(logs, one.log_multipliers))].real for one in beside)
    slope = (above - below) / (2 * step)
    away = np.divide(size, np.abs(slope), out=np.full(len(size), np.inf), where=slope != 0)
    lead = int(np.argmin(away))  # the one that crosses; a free rigid motion's is zero too, but has no slope
    return replace(found, slope=float(slope[lead]), error=max(float(away[lead]), found.error))


def describe_causes(family: Family, point: Array) -> str:
    """What makes a system unstable at a point (P,), in words."""
    cause = next(iter(family.resonances(point)), None)
    if cause is None:
        return "its growth is too slow to name a resonance"
    if cause.kind == "average":
        return cause.own_cause
    return f"{cause.kind} resonance of order {cause.order}: {cause.condition}"


UNASKED_SECONDS = 1.25
"""Seconds of work planned for all numbers that nobody asked for, of which about one is taken: by then the verdict of every built-in
scene with damping is settled about its own numbers."""


@immutable
class Margin:
    """The critical values of one number between low and high, and the scene's own value; values: how many were tried; gap: the widest part
    of the range in which a change may hide since the search had to end, 0 where it did not; searched: ends of the part about its own value
    in which none can."""

    path: str
    low: float
    high: float
    own: float
    values: int
    critical: tuple[CriticalValue, ...]
    gap: float = 0.0
    searched: tuple[float, float] = (-inf, inf)

    @property
    def nearest(self) -> CriticalValue | None:
        """The critical value nearest to the scene's own, those of closed tongues left out."""
        open_ = [one for one in self.critical if not one.touching]
        return min(open_, key=lambda one: abs(one.distance), default=None)


def find_margin(
    scene: Scene,
    path: str,
    limits: tuple[float, float],
    seconds: float = inf,
    known: Linearization | None = None,
    loop: str = "own",
) -> Margin:
    """The critical values of one number of a scene's loop, by default its own, to 1e-6 of the range, or as many as some seconds bring.

    Parameters: known: the loop; where its equations keep the number free they are not derived again.
    Raises: what `make_family` raises; ArgumentError for what is no real number of the scene (`need_numbers`).
    """
    need_numbers(scene, (path,))
    own = float(get_value(scene, path))
    (low, high), effort = check_limits(path, limits), Effort(seconds, own)
    kept = known if known is not None and path in known.arm.parameters.paths else None
    family = make_family(scene, {path: (low, high)}, loop, kept)
    family.finest = 1e-9  # it moves a value by less than is printed
    found = search_family(family, path, (low, high), 1e-6 * (high - low), SCAN_VALUES, effort)
    searched = max(low, effort.searched[0]), min(high, effort.searched[1])
    return Margin(path, low, high, own, effort.values, tuple(found), effort.gap, searched)


def choose_margins(scene: Scene) -> dict[str, tuple[float, float]]:
    """The numbers that engineers ask for first, speed and payload, from a quarter to eight times the scene's own values."""
    motion = ("motion.frequency", "motion.move_time", "motion.joints.0.rate")
    known = dict(find_number(scene, path) for path in (*motion, "effects.payload.mass", "parameters.payload_mass"))
    return {path: (min(own / 4, 8 * own), max(own / 4, 8 * own)) for path, own in known.items() if own}


def find_number(scene: Scene, path: str) -> tuple[str, float]:
    """A number of the scene with its path, of a list the last one, which is that of the load at the tip; 0 where there is none."""
    with suppress(ArgumentError):
        value = get_value(scene, path)
        if isinstance(value, list | tuple):
            path, value = f"{path}.{len(value) - 1}", value[-1]
        return path, value if isinstance(value, float) else 0.0
    return path, 0.0


@immutable
class BoundaryCurve:
    """A curve in two numbers that parts stability from instability; the unstable side is on its left.

    Attributes
    ----------
    paths : (str, str)
        Dotted paths of both numbers.
    points : array, shape (N, 2)
        The curve as a polyline, in the numbers' units, as fine as the wanted error asks.
    error : array, shape (N,)
        Distance of each point from the exact boundary, in the unit of the number with the longer range: each range counts as that long.
    closed : bool
        Whether the curve ends where it begins: the rim of an island, or of a hole.
    resonance : str
        What makes the loop unstable beside the curve's middle, in words.
    inside : (float, float)
        An unstable point beside the curve's middle.
    evaluations : int
        Spectra that the search for all curves took.
    lost : array, shape (K, 2)
        Ends inside the ranges: the boundary goes on there, and was not found; none where all of it was.
    status : str
        Whether every point is as near to the boundary as was asked, and if not, how far off, where, and what to do.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("spinning-link")
    >>> ranges = {"motion.joints.0.rate": (3.5, 4.5), "effects.gravity.acceleration": (1.0, 4.0)}
    >>> curves = fl.stability_boundary(scene, ranges, tol=1e-4)
    >>> len(curves), curves[0].closed, curves[0].resonance[:30]
    (2, False, 'principal resonance of order 2')
    """

    paths: tuple[str, str]
    points: Array
    error: Array
    closed: bool
    resonance: str
    inside: tuple[float, float]
    evaluations: int
    lost: Array
    status: str


@checked
def stability_boundary(
    source: Source,
    ranges: Ranges,
    tol: float = 1e-6,
    *,
    loop: str = "own",
    cells: int = CELLS,
) -> list[BoundaryCurve]:
    """Find the curves in two numbers, within their ranges, along which a loop becomes unstable.

        max_i Re lambda_i(p, q) = 0

    Spectra on the lines of a lattice give the points at which the boundary crosses them, tongues between two lattice points included;
    through each cell the points are joined by cubics whose middles are compared with the boundary itself, and which are halved until
    they agree. Islands and holes wider than a cell are found; smaller ones where the growth rate peaks at a lattice point beside them.
    Tongues are followed into the tips at which they close, to within rounding.

    Parameters
    ----------
    source : Scene, PeriodicFamily, or function of two floats that returns a PeriodicSystem
        The scene; or the systems themselves, where there is no scene. A family's go through compiled code together.
    ranges : mapping of str to (float, float)
        Two dotted paths with the least and largest value of each, in the numbers' units.
    tol : float
        Wanted distance of the curves from the exact boundary: in the numbers' units, or as a share of a range shorter than one.
    loop : str
        Which loop of the scene, as in `critical_values`.
    cells : int
        Cells of the lattice on either side.

    Returns
    -------
    list of BoundaryCurve
        Longest first; empty where the verdict is the same everywhere.

    Raises
    ------
    ArgumentError
        For paths that lead to no free numbers, ranges that do not rise, or an unknown loop.
    SceneError
        For ranges that the scene's schema refuses.
    ModelError
        For ranges in which the equations break, as where M is indefinite.

    References
    ----------
    Allgower, Georg, Introduction to Numerical Continuation Methods (2003), ch. 15, for curves from a lattice; Seyranian, Mailybaev,
    Multiparameter Stability Theory with Mechanical Applications (2003), ch. 11, for boundaries of parametric resonance.

    Examples
    --------
    Both sides of the first tongue of a damped Mathieu equation, y'' + 0.2 y' + (a - 2 q cos 2t) y = 0, meet at its tip:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> def mathieu(a, q):
    ...     def stiffness(t):
    ...         return (a - 2 * q * np.cos(2 * t))[:, None, None]
    ...     return fl.PeriodicSystem.from_second_order([[1.0]], [[0.2]], stiffness, np.pi)
    >>> (curve,) = fl.stability_boundary(mathieu, {"a": (0.6, 1.4), "q": (0.0, 0.3)}, tol=1e-3, cells=4)
    >>> bool(abs(curve.points[:, 1].min() - 0.2) < 2e-3)
    True
    """
    if len(ranges) != 2:
        expected = "two numbers with their ranges"
        raise ArgumentError("a boundary has two parameters", got=", ".join(ranges) or "none", expected=expected)
    return search_boundary(source, ranges, positive("tol", tol), loop, whole("cells", cells, 2), Effort())


def search_boundary(
    source: Source, ranges: Ranges, tol: float, loop: str, cells: int, effort: Effort
) -> list[BoundaryCurve]:
    """The curves of `stability_boundary`; effort: ends the search for tongues' tips, and knows whether it did."""
    limits = np.array([check_limits(path, limits) for path, limits in ranges.items()])
    low, span = limits[:, 0], limits[:, 1] - limits[:, 0]
    share = tol / max(1.0, float(span.max()))
    # it moves a place by a small part of the wanted distance
    coarsest = float(np.clip(MINOR * share, SCAN_ERROR, LOOSE_LOG_ERROR))
    family = make_family(source, ranges, loop, coarsest=coarsest)
    constant = family.is_constant(low + span / 2)
    found = find_curves(lambda points: family.rough(low + span * points), share, cells, constant, effort)
    curves, (first, second) = list[BoundaryCurve](), ranges
    for curve, ends in zip(found, find_lost_ends(found), strict=True):
        points, lost, error = low + span * curve.points, low + span * ends, curve.errors * float(span.max())
        status = describe_errors((first, second), points, error, share * float(span.max()))
        if len(lost):
            place = name_place((first, second), lost[0])
            status += f"; it was lost at {place}: ask for narrower ranges around that place"
        p, q = (low + span * curve.inside).tolist()
        text = describe_causes(family, np.array([p, q]))
        known = curve.closed, text, (p, q), family.evaluations, lost, status
        curves.append(BoundaryCurve((first, second), points, error, *known))
    return sorted(curves, key=lambda curve: -len(curve.points))


def describe_errors(paths: tuple[str, str], points: Array, error: Array, wanted: float) -> str:
    """Whether a curve is as near to the boundary as was asked, and what to do if it is not."""
    worst, far = int(error.argmax()), int((error > wanted).sum())
    if not far:
        return f"every point lies within {error[worst]:.1e} of the boundary"
    where = name_place(paths, points[worst])
    return (
        f"{far} of {counted(len(points), 'point')} may lie further from the boundary than the {wanted:.1e} asked for, "
        f"up to {error[worst]:.1e} at {where}; ask for narrower ranges around that place, or for a larger tol"
    )


def name_place(paths: tuple[str, str], point: Array) -> str:
    """Both numbers at a point."""
    return ", ".join(f"{path} = {value:.6g}" for path, value in zip(paths, point, strict=True))
