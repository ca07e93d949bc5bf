"""How far the linear model is valid: where the nonlinear terms of the equations along a linear motion reach a share of the linear ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PPoly
from scipy.optimize import brentq

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, SUM_ROUNDING, Array, positive
from flexlin.control.slow_motions import SLOW_TOL, interpolate, slow_motions
from flexlin.lazy import lazy
from flexlin.linearization.linear import linearize
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.coordinates import Coordinate
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.precision import LARGEST_LOG_GROWTH, SAFETY, SLIGHT
from flexlin.summary import immutable

LARGEST_AMPLITUDE, SMALLEST_AMPLITUDE = 10.0, 1e-7
"""Amplitudes between which the border is sought, in rad or m."""
REFINED_PEAKS = 8
"""Times of large shares that are looked at more closely, and places of an interval between two nodes where they are sought."""
LOOK_TIMES, LOOK_ROUNDS = 9, 4
"""Times of a look at a peak; how many looks there are, each as wide as the space between two times of the one before, and how often peaks
are sought at the most."""


@dataclass(frozen=True, eq=False)
class Terms:
    """A linear motion in the equations at times t (N,): y, y', y'' (3, N, n); M (N, n, n); K y, D y', M y'' (3, N, n); and what the
    equations leave where nothing deviates (N, n)."""

    plant: Linearization
    t: Array
    motion: Array
    mass: Array
    parts: Array
    rest: Array

    @classmethod
    def along(cls, plant: Linearization, t: Array, motion: PPoly) -> "Terms":
        """The terms of a motion at times t."""
        resolved = plant.periodic_system().resolved
        assert isinstance(resolved, ResolvedCompanion)
        M, D, K = resolved.sample(t % plant.period)
        z = np.array([motion(t, order) for order in range(3)])
        parts = np.array([np.einsum("tij,tj->ti", matrix, part) for matrix, part in zip((K, D, M), z, strict=True)])
        return cls(plant, t, z, M, parts, residual(plant, t, np.zeros_like(z)))

    @lazy
    def linear(self) -> Array:
        """The size of the largest linear term at each time, (N,)."""
        return np.asarray(size(self.mass, *self.parts).max(axis=0))

    def nonlinear(self, a: float) -> Array:
        """|R(a)| at each time."""
        left = residual(self.plant, self.t, a * self.motion) - self.rest - a * self.parts.sum(axis=0)
        return np.asarray(size(self.mass, left)[0])


@dataclass(frozen=True, eq=False)
class Along:
    """One linear motion over a period, as it is and from every second node alone, in the equations of the arm."""

    plant: Linearization
    motion: PPoly
    coarse: PPoly
    share: float

    @lazy
    def grid(self) -> Terms:
        """The terms at the nodes and between them."""
        nodes = self.motion.x
        t = nodes[:-1, None] + np.diff(nodes)[:, None] * np.arange(REFINED_PEAKS) / REFINED_PEAKS
        return Terms.along(self.plant, np.append(t, nodes[-1]), self.motion)

    @lazy
    def rounding(self) -> float:
        """Of |R|: what is left of it at an amplitude of no account."""
        return SAFETY * float(self.grid.nonlinear(SUM_ROUNDING).max())

    @np.errstate(divide="ignore", invalid="ignore", over="ignore")
    def excess(self, terms: Terms, a: float) -> Array:
        """The logarithm of |R(a)|, less its rounding, against the share of the linear terms; LARGEST_LOG_GROWTH where it is no number."""
        nonlinear = terms.nonlinear(a)
        ratio = np.log((nonlinear - self.rounding) / (self.share * a * terms.linear))
        finite = np.clip(np.nan_to_num(ratio, nan=LARGEST_LOG_GROWTH), -LARGEST_LOG_GROWTH, LARGEST_LOG_GROWTH)
        return np.where(nonlinear <= self.rounding, -LARGEST_LOG_GROWTH, finite)

    def peaks(self, a: float) -> tuple[Terms, Array]:
        """The terms at the times of the largest shares at an amplitude, and how much the logarithms there rose in the last look.

        They are sought on the grid, and where the coefficients are known to be narrow.
        """
        excess = np.pad(self.excess(self.grid, a), 1, constant_values=-np.inf)
        higher = np.flatnonzero((excess[1:-1] >= excess[:-2]) & (excess[1:-1] >= excess[2:]))
        chosen = higher[np.argsort(excess[1 + higher])[-REFINED_PEAKS:]]
        named = np.array(self.plant.features).reshape(-1, 2)
        t, width = np.concatenate([[self.grid.t[chosen], np.gradient(self.grid.t)[chosen]], named.T], axis=1)
        found, rose = np.full(len(t), -np.inf), np.full(len(t), np.inf)
        for _ in range(LOOK_ROUNDS):
            near = np.clip(t[:, None] + width[:, None] * np.linspace(-1, 1, LOOK_TIMES), 0.0, self.motion.x[-1])
            shares = self.excess(Terms.along(self.plant, near.ravel(), self.motion), a).reshape(near.shape)
            best = shares.argmax(axis=1)[:, None]
            t, largest = np.take_along_axis(near, best, 1)[:, 0], np.take_along_axis(shares, best, 1)[:, 0]
            rose, found = largest - found, largest
            width = np.where(best[:, 0] % (LOOK_TIMES - 1) > 0, 2 * width / (LOOK_TIMES - 1), width)
        return Terms.along(self.plant, t, self.motion), np.abs(rose)


@immutable
class Validity:
    """How large a deflection along the slowest Floquet modes the linear model bears.

    Attributes
    ----------
    directions : array, shape (k, 2n)
        Starts [y; y'] of linear motions whose largest deflection over a period is 1, in the unit of the coordinate that makes it.
    amplitudes : array, shape (k,)
        Where the nonlinear terms reach `share` of the linear ones, in the unit of `leading`: inf where they do not up to 10, 0 where
        they exceed it at 1e-7 already.
    share : float
        The share.
    leading : tuple of Coordinate
        The coordinate of each direction whose deflection is the amplitude, in its unit; the others deflect by less.
    errors : array, shape (k,)
        Of the amplitudes, about: what the search, the time of the largest share and the motion between its nodes leave open.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.control.validity import Validity
    >>> plant = fl.linearize(fl.build_manipulator(scene := fl.load_scene("khang-2019")), scene.motion)
    >>> print(Validity(np.eye(4)[:2], np.array([0.2, 0.5]), 0.1, plant.coordinates, np.full(2, 1e-4)).status.split(", where")[0])
    the linear model serves for disturbances of up to 0.2 ± 1e-04 rad in q1
    """

    directions: Array
    amplitudes: Array
    share: float
    leading: tuple[Coordinate, ...]
    errors: Array

    @property
    def status(self) -> str:
        """What the smallest amplitude means."""
        worst, percent = int(np.argmin(self.amplitudes)), f"{100 * self.share:g} % of what it keeps"
        smallest, at = self.amplitudes[worst], self.leading[worst]
        where = f"{at.unit} in {at.title}"
        if not np.isfinite(smallest):
            return (
                f"the linear model serves for disturbances of up to {LARGEST_AMPLITUDE:g} {where}, the largest tried: along the slowest "
                f"modes what it leaves out stays below {percent}"
            )
        if smallest == 0.0:
            return (
                f"what the linear model leaves out exceeds {percent} already at deflections of {SMALLEST_AMPLITUDE:g} {where}: "
                "it holds nowhere here; trust the nonlinear simulation, or smooth what is abrupt (Coulomb friction)"
            )
        return (
            f"the linear model serves for disturbances of up to {smallest:.3g} ± {self.errors[worst]:.0e} {where}, where along the slowest "
            f"modes what it leaves out reaches {percent}; simulate larger ones"
        )


@checked
def linear_range(
    lin: Linearization,
    share: float = 0.1,
    modes: int = 2,
    result: FloquetResult | None = None,
    tol: float = 1e-8,
    plant: Linearization | None = None,
) -> Validity:
    """Find the amplitude at which the nonlinear terms reach a share of the linear terms, along the slowest Floquet modes.

        r(s_R + a z) = r(s_R) + a (M z'' + D z' + K z) + R(a),   max over t of |R(a)| / (a max(|M z''|, |D z'|, |K z|)) = share

    z(t) is the motion that starts in the mode's direction; the linear terms are measured one by one, since along z they balance
    the feedback. |f|^2 = f' M^-1 f weighs forces by the accelerations that they cause, so rad and m may stand side by side.
    R holds all orders; for a small share it is the second-order term, a^2/2 r''[z, z].
    The share peaks where all linear terms are small, often within a thousandth of a period: t is any time, between samples too.

    Parameters
    ----------
    lin : Linearization
        With the loop closed.
    share : float
        Share of the linear terms, in (0, 1].
    modes : int
        How many of the slowest modes.
    result : FloquetResult, optional
        Floquet's answer for the loop, if it is known.
    tol : float
        Relative width of the bracket in which the search for an amplitude ends.
    plant : Linearization, optional
        The same arm along the same motion without a loop, if it is known.

    Returns
    -------
    Validity
        Directions, amplitudes with their errors, and what they mean.

    Raises
    ------
    ArgumentError
        For a share that is not positive.
    NumericalError, TooLarge
        When modes of this loop are too fast to be resolved.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> print(f"{fl.control.linear_range(lin, modes=1).amplitudes.min():.2f}")
    0.07
    """
    positive("share", share)
    positive("tol", tol)
    system = lin.periodic_system()
    slow = slow_motions(system, modes, result, SAMPLES, lin.n)
    bare = plant or (lin if lin.control is None else linearize(lin.arm, lin.motion))
    motions = interpolate(system, lin.n, slow)
    largest = np.array([largest_deflection(motion) for motion in motions])
    coarse = interpolate(system, lin.n, slow.thinned())
    found = [border(Along(bare, *both, share), tol) for both in zip(motions, coarse, strict=True)]
    amplitudes, errors = largest * np.array(found).T
    leading = tuple(lin.coordinates[int(np.abs(x[:, : lin.n]).max(axis=0).argmax())] for x in slow.states)
    return Validity(slow.directions / largest[:, None], amplitudes, share, leading, errors)


def largest_deflection(motion: PPoly) -> float:
    """The largest |y_i(t)| over the period."""
    t = motion.x
    k = int(np.abs(motion(t)).max(axis=1).argmax())
    return float(np.abs(motion(np.linspace(t[max(0, k - 1)], t[min(len(t) - 1, k + 1)], SAMPLES + 1))).max())


def border(along: Along, tol: float) -> tuple[float, float]:
    """The amplitude of a linear motion at which the nonlinear share is reached, and its error.

    It is sought at the times of the largest shares, and these at the amplitude that was found, until it falls no more.
    """
    found = search_border(along, Terms.along(along.plant, along.motion.x, along.motion), tol)
    for _ in range(LOOK_ROUNDS):
        if found == 0.0:
            return found, SMALLEST_AMPLITUDE
        peaks, rose = along.peaks(min(found, LARGEST_AMPLITUDE))
        before, found = found, min(found, search_border(along, peaks, tol))
        if found >= before * (1 - tol):
            break
    return found, estimate_error(along, peaks, rose, found, tol)


def search_border(along: Along, terms: Terms, tol: float) -> float:
    """The amplitude between SMALLEST_AMPLITUDE and LARGEST_AMPLITUDE that reaches the share at one of the times; 0 or inf beyond these."""

    def excess(log: float) -> float:
        """Nearly linear in log a."""
        return float(along.excess(terms, float(np.exp(log))).max())

    low, high = np.log([SMALLEST_AMPLITUDE, LARGEST_AMPLITUDE])
    if excess(high) <= 0:
        return np.inf
    if excess(low) > 0:
        return 0.0
    return float(np.exp(brentq(excess, low, high, xtol=tol)))


def estimate_error(along: Along, peaks: Terms, rose: Array, amplitude: float, tol: float) -> float:
    """Of an amplitude at which the share is reached at one of the peaks: by how much the share there is uncertain, against its slope.

    It is what the last look at the peak changed, the rounding, and what the motion between every second node gives in its place.
    """
    if not 0.0 < amplitude < np.inf:
        return np.nan
    excess, steeper = (along.excess(peaks, a) for a in (amplitude, (1 + SLIGHT) * amplitude))
    coarse, k = along.excess(Terms.along(along.plant, peaks.t, along.coarse), amplitude), int(excess.argmax())
    left = along.rounding / max(float(peaks.nonlinear(amplitude)[k]), along.rounding)
    apart = float(rose[k]) + abs(float(coarse[k] - excess[k])) + left + SLOW_TOL
    slope = abs(float(steeper.max() - excess[k])) / np.log1p(SLIGHT)
    return float(amplitude * (tol + min(apart / max(slope, apart), 1.0)))


def size(M: Array, *forces: Array) -> Array:
    """sqrt(f' M^-1 f) of each force at each time: (forces, N)."""
    f = np.moveaxis(np.array(forces), 0, -1)
    return np.sqrt(np.einsum("tik,tik->kt", f, np.linalg.solve(M, f)))


def residual(plant: Linearization, t: Array, motion: Sequence[Array] | Array) -> Array:
    """The left side of the equations of motion, kept rows, at deviations y, y', y'' from the rigid motion."""
    return plant.about.of_arm("residual", t, *motion)[:, list(plant.kept), 0]
