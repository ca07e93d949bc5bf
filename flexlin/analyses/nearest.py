"""How much of its uncertainty a loop endures: the smallest change of its numbers that makes it unstable."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np
from scipy.optimize import brentq, minimize

from flexlin.analyses.spectra import Family, Ranges, Source, make_family
from flexlin.arguments import checked
from flexlin.checks import Array, positive
from flexlin.errors import ArgumentError, InputError, NotStable
from flexlin.lazy import lazy
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.scene.loading import check_axes
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

FURTHEST_CHANGE = 4.0
"""Multiple of the stated changes up to which is searched, as far as the scene's schema goes."""
DIFFERENCE_STEP = 1e-5
"""Distance of places beside one: of the differences that stand for slopes, and, as a share of the change, of those that confirm a crossing,
where its error is not larger."""


@dataclass
class Box:
    """Numbers by their changes u: own at 0, the ends at -1 and +1; no further than `most` (2, P), down and up."""

    family: Family
    paths: tuple[str, ...]
    own: Array
    low: Array
    high: Array
    most: Array
    known: dict[bytes, FloquetResult] = field(default_factory=dict)

    @lazy
    def furthest(self) -> float:
        """The largest multiple that is tried."""
        return float(self.most.max())

    def values(self, u: Array) -> Array:
        """The numbers (..., P) at changes (..., P)."""
        u = np.clip(u, -self.most[0], self.most[1])
        return np.asarray(self.own + np.abs(u) * (np.where(u < 0, self.low, self.high) - self.own))

    def judge(self, u: Array) -> FloquetResult:
        """The exponents at one place, computed once."""
        values = self.values(u)
        key = values.tobytes()
        if key not in self.known:
            self.known[key] = floquet(self.family.system_at(values))
        return self.known[key]

    def growth(self, u: Array) -> float:
        """The growth rate at one place, in 1/s."""
        return float(self.judge(u).exponents[0].real)

    def slope(self, u: Array) -> Array:
        """The growth rate's derivatives by u (P,), by differences to the inside: of many states exact ones take 100 times as long."""
        steps = np.where(u > 0, -DIFFERENCE_STEP, DIFFERENCE_STEP)
        return np.asarray([self.growth(u + one) - self.growth(u) for one in np.diag(steps)]) / steps

    def uphill(self) -> Array:
        """For each number the side of the scene's own, -1 or 1, to which the growth rate rises, or to which alone it can go."""
        return np.where((self.slope(np.zeros(len(self.own))) < 0) | (self.high == self.own), -1.0, 1.0)


def make_box(
    source: Source,
    ranges: Ranges | None = None,
    loop: str = "own",
    own: Sequence[float] | None = None,
    furthest: float = FURTHEST_CHANGE,
) -> Box:
    """The numbers with their ends, by default those of the scene's table [uncertainty], as far as its schema lets them go.

    Raises: ArgumentError where no ranges are known, they do not hold the loop's own numbers, or a path leads to no free number.
    """
    if ranges is None and isinstance(source, Scene):
        ranges = {path: (one.low, one.high) for path, one in source.uncertainty.items()}
    ends = {path: (float(low), float(high)) for path, (low, high) in (ranges or {}).items()}
    if not ends:
        raise ArgumentError("no range is known", expected="ranges, or a table [uncertainty] in the scene")
    family, most = make_family(source, ends, loop), []
    if not isinstance(source, Scene):
        family.own = np.broadcast_to(np.asarray(np.nan if own is None else own, dtype=float), len(ends))
    for (path, (low, high)), value in zip(ends.items(), family.own.tolist(), strict=True):
        if not (low <= value <= high and low < high):
            got = f"{low:g} to {high:g}"
            expected = f"{value:g} between them" if np.isfinite(value) else "own numbers, one for each range"
            raise ArgumentError(f"the range of {path} does not hold the loop's own number", got=got, expected=expected)
        most.append([allowed(source, path, value, end, furthest) for end in (low, high)])
    lows, highs = np.array(list(ends.values())).T
    return Box(family, tuple(ends), family.own, lows, highs, np.array(most).T)


def allowed(source: Source, path: str, own: float, end: float, furthest: float) -> float:
    """The multiple of a number's change to one end up to which a scene's schema accepts it."""
    if not isinstance(source, Scene):
        return furthest
    for size in np.arange(min(furthest, FURTHEST_CHANGE), 1.0, -0.5).tolist():
        with suppress(InputError):
            check_axes(source, {path: np.array([own, own + size * (end - own)])}, grid=True)
            return size
    return min(furthest, 1.0)


CORNERS, RAY_DISTANCES = 64, 20
"""Directions to corners of the box, half as many spread over its faces, and distances tried on each, the nearest first."""
GRADIENT_DISTANCES = 8
"""Distances tried along the growth rate's gradient and its parts alone, for a loop whose spectra take long."""
SEARCH_RAYS, RAY_STEPS = 2, 12
"""Rays from which the nearest place is sought, and steps of each."""


def list_directions(box: Box) -> Array:
    """Axes, corners and a spread over the faces (D, P), each with a largest entry of 1; along the growth rate's gradient where dear."""
    from scipy.stats import qmc  # takes longer to load than most reports to compute

    P = len(box.own)
    if box.family.slow:
        uphill = box.uphill()
        return np.unique(np.vstack([uphill, np.diag(uphill)]), axis=0)
    ends, draw = [-1.0, 1.0], np.random.default_rng(0).choice
    signs = list(product(ends, repeat=P)) if 2**P <= CORNERS else draw(ends, (CORNERS, P))
    inside = 2 * qmc.Sobol(P, seed=0).random(CORNERS // 2) - 1
    faces = inside / np.abs(inside).max(axis=1, keepdims=True) if P > 1 else inside[:0]
    return np.unique(np.vstack([np.eye(P), -np.eye(P), signs, faces]), axis=0)


def scan(box: Box) -> list[tuple[Array, float]]:
    """The rays that are unstable at the nearest distance at which one is: direction and crossing."""
    directions = list_directions(box)
    count = GRADIENT_DISTANCES if box.family.slow else RAY_DISTANCES
    levels = box.furthest * np.arange(count + 1) / count
    for before, level in pairwise(levels):
        unstable = directions[box.family.rough(box.values(level * directions)).logs.real.max(axis=1) > 0]
        rays = [d for d in unstable if box.growth(level * d) > 0 > box.growth(before * d)]
        if rays:
            found = [(d, cross(box, d, before, level)) for d in rays[: 4 * SEARCH_RAYS]]
            return sorted(found, key=lambda ray: ray[1])[:SEARCH_RAYS]
    return []


def follow(box: Box, direction: Array, scale: float) -> Array:
    """Follow the boundary of stability from r d to the smallest r: the least of r(d) for -1 <= d <= 1.

    growth(r d) = 0,   dr/dd_i = -r g_i / (g . d),   g: the growth rate's gradient at r d
    """
    places = [scale * direction]

    def shortest(d: Array) -> tuple[float, Array]:
        r = find_crossing(box, d, float(np.abs(places[-1]).max()))
        if not np.isfinite(r):
            return 4 * box.furthest, np.zeros(len(d))
        if r * np.abs(d).max() < np.abs(places[-1]).max():
            places.append(r * d)
        g = box.slope(r * d)
        return r, -r * g / float(g @ d)

    bounds = [(-1.0, 1.0)] * len(direction)
    options = {"maxiter": RAY_STEPS, "maxfun": 2 * RAY_STEPS, "ftol": 1e-7}
    minimize(shortest, direction, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return np.asarray(places[-1])


def find_crossing(box: Box, direction: Array, near: float) -> float:
    """The scale on a ray at which the growth rate is zero, up to twice one that is known on another ray; infinite where there is none."""
    for stable, unstable in ((0.0, near), (near, 2 * near)):
        if box.growth(unstable * direction) > 0:
            return cross(box, direction, stable, unstable)
    return float(np.inf)


def cross(box: Box, direction: Array, stable: float, unstable: float) -> float:
    """The scale on a ray at which the growth rate is zero, between a stable and an unstable one."""
    return float(brentq(lambda r: box.growth(r * direction), stable, unstable, xtol=1e-12, rtol=1e-12))


@immutable
class NearestInstability:
    """The smallest change of uncertain numbers, in units of what is stated of each, that makes a loop unstable.

    Attributes
    ----------
    paths : tuple of str
        The numbers.
    own : array, shape (P,)
        Their values in the scene.
    values : array, shape (P,)
        Their values where the loop becomes unstable; not numbers where no such place was found.
    scale : float
        The largest change of one of them, as a multiple of the change that is stated for it; infinite where none was found.
    error : float
        Of the scale along the way to the place: the exponent's error over its slope.
    confirmed : bool
        Whether `floquet` calls the loop stable just before the place and unstable just behind it.
    furthest : float
        The multiple up to which was searched.
    tried : int
        Spectra that were computed.
    growth : tuple of float
        The smallest and largest growth rate at the scene's own numbers and at the corners and faces of the stated ranges, in 1/s.

    Examples
    --------
    >>> import flexlin as fl
    >>> def loop(stiffness, damping):
    ...     return fl.PeriodicSystem([[0.0, 1.0], [-stiffness, -damping]], 1.0)
    >>> found = fl.nearest_instability(loop, {"stiffness": (0.5, 1.5), "damping": (0.1, 0.3)}, own=[1.0, 0.2])
    >>> print(found.status)
    no instability found within the stated ranges; unstable from 2 times these changes on
    """

    paths: tuple[str, ...]
    own: Array
    values: Array
    scale: float
    error: float
    confirmed: bool
    furthest: float
    tried: int
    growth: tuple[float, float]

    @property
    def status(self) -> str:
        """What to make of it."""
        if not np.isfinite(self.scale):
            return f"no instability found up to {self.furthest:g} times the stated changes, at {self.tried} places"
        if not self.confirmed:
            return f"undecided: near {self.scale:.4g} times the stated changes the verdict could not be confirmed"
        if self.scale <= 1:
            return f"unstable within the stated ranges, from {self.scale:.4g} of the changes on"
        return f"no instability found within the stated ranges; unstable from {self.scale:.4g} times these changes on"


@checked
def nearest_instability(
    source: Source,
    ranges: Ranges | None = None,
    *,
    loop: str = "own",
    own: Sequence[float] | None = None,
    furthest: float = FURTHEST_CHANGE,
) -> NearestInstability:
    """Find the smallest change of uncertain numbers, all of them at once, that makes a loop unstable.

        min r   with   max_i Re lambda_i(own + u * change) = 0,   max_j |u_j| = r

    Rays from the scene's own numbers to corners, faces and axes of the box are scanned; from the nearest crossings the boundary is
    followed along the growth rate's exact gradient g to where no change of the same size grows faster, u = r sign(g), and the place is
    confirmed by `floquet`. A search, no proof: an island of instability between the rays may be missed. Assumes a stable loop.

    Parameters
    ----------
    source : Scene, or function of one number for each range that returns a PeriodicSystem
        Where the loop comes from.
    ranges : mapping of path to (low, high), optional
        What is known of each number; by default the scene's own table `[uncertainty]`.
    loop : str
        own, open, or the name of one of the scene's designs, whose gains stay as designed.
    own : sequence of floats, optional
        The numbers of a function; a scene has its own.
    furthest : float
        Multiple of the stated changes up to which is searched, at most.

    Returns
    -------
    NearestInstability
        The place, its scale, and whether it was confirmed.

    Raises
    ------
    ArgumentError
        Where no ranges are known, or a path leads to no free number.
    NotStable
        When the loop is not stable as it is.

    See Also
    --------
    critical_values : Every value of one number at which the verdict changes, none missed.

    References
    ----------
    Seyranian, Mailybaev, Multiparameter Stability Theory with Mechanical Applications (2003), section 9.3 (the gradient); Zhou, Doyle,
    Essentials of Robust Control (1998), ch. 10 (the size of a change as the largest of its parts).

    Examples
    --------
    y'' + d y' + k y = 0 loses its damping at d = 0, twice the stated change of 0.1:

    >>> import flexlin as fl
    >>> def loop(stiffness, damping):
    ...     return fl.PeriodicSystem([[0.0, 1.0], [-stiffness, -damping]], 1.0)
    >>> found = fl.nearest_instability(loop, {"stiffness": (0.5, 1.5), "damping": (0.1, 0.3)}, own=[1.0, 0.2])
    >>> round(found.scale, 9), found.confirmed, [round(rate, 9) for rate in found.growth]
    (2.0, True, [-0.15, -0.05])
    """
    return search_box(make_box(source, ranges, loop, own, positive("furthest", furthest)))


def search_box(box: Box) -> NearestInstability:
    """The nearest place of instability. Raises: NotStable when the loop is not stable as it is."""
    at_rest = box.judge(np.zeros(len(box.own)))
    if at_rest.verdict != "stable":
        raise NotStable(f"the loop is {at_rest.verdict} as it is", got=at_rest.status, expected="a stable loop")
    growth = find_spread(box)
    places = [follow(box, *ray) for ray in scan(box)]
    about = box.furthest, box.family.evaluations + len(box.known), growth
    if not places:
        return NearestInstability(box.paths, box.own, np.full(len(box.own), np.nan), np.inf, 0.0, False, *about)
    u = min(places, key=lambda place: float(np.abs(place).max()))
    scale = float(np.abs(u).max())
    error, confirmed = confirm(box, u / scale, scale)
    return NearestInstability(box.paths, box.own, box.values(u), scale, error, confirmed, *about)


def find_spread(box: Box) -> tuple[float, float]:
    """The smallest and the largest growth rate at the box's middle, corners and faces; the extremes of approximate spectra, judged."""
    directions = list_directions(box)
    places = np.vstack([np.zeros(len(box.own)), directions, -directions])
    rough = box.family.rough(box.values(places)).logs.real.max(axis=1)
    found = [box.growth(places[k]) for k in (0, int(np.nanargmin(rough)), int(np.nanargmax(rough)))]
    return min(found), max(found)


def confirm(box: Box, direction: Array, scale: float) -> tuple[float, bool]:
    """The scale's error, the exponent's over the growth rate's slope along the ray; and whether the loop is stable just before the place
    and unstable just behind."""
    step = 1e-4 * scale
    slope = (box.growth((scale + step) * direction) - box.growth((scale - step) * direction)) / (2 * step)
    error = float(box.judge(scale * direction).errors[0] / abs(slope)) if slope else np.inf
    apart = max(2 * error, DIFFERENCE_STEP * scale)
    verdicts = [box.judge((scale + side) * direction).verdict for side in (-apart, apart)]
    return error, verdicts == ["stable", "unstable"]
