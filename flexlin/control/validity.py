"""How far the linear model is valid: where the nonlinear terms of the equations along a linear motion reach a share of the linear ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexlin.about.linear import linearize
from flexlin.about.linearization import Linearization
from flexlin.arguments import checked, instance
from flexlin.checks import SAMPLES, Array, positive
from flexlin.control.slow_motions import SLOW_TOL, LinearMotion, slow_motions
from flexlin.mechanics.coordinates import Coordinate
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.resolved.matrix import ResolvedCompanion
from flexlin.periodic.roots import SignedEnds, solve_brackets
from flexlin.summary import represent

LARGEST, SMALLEST = 10.0, 1e-7
"""Amplitudes between which the border is sought, in rad or m."""
FIRST = 1e-3
"""The amplitude at which the times of the largest shares are sought first."""
REPEATS = 6
"""Searches among the times of largest share at the most."""
STEP = 1.01
"""The factor by which the amplitude is changed to see how fast the share grows with it."""
HUGE = 700.0
"""A logarithm beyond all numbers."""
STILL = 1e-14
"""An amplitude at which only rounding is left of the nonlinear terms."""
WITHIN = 8
"""Places of an interval between two nodes where a share is estimated from the terms at the nodes."""
PEAKS, MOST = 8, 64
"""Times of large shares that are looked at more closely; named features that are."""
LOOK, ROUNDS = 9, 4
"""Times of a look at a peak; how many looks there are, each as wide as the space between two times of the one before."""


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
    def along(cls, plant: Linearization, t: Array, motion: Array) -> "Terms":
        """The terms of a motion y, y', y'' (3, N, n) at times t (N,)."""
        resolved = plant.periodic_system().resolved
        assert isinstance(resolved, ResolvedCompanion)
        M, D, K = resolved.sample(t % plant.period)
        parts = np.array([np.einsum("tij,tj->ti", matrix, z) for matrix, z in zip((K, D, M), motion, strict=True)])
        return cls(plant, t, motion, M, parts, residual(plant, t, np.zeros_like(motion)))

    @property
    def linear(self) -> Array:
        """The size of the largest linear term at each time, (N,)."""
        return np.asarray(size(self.mass, *self.parts).max(axis=0))

    def left(self, a: float) -> Array:
        """R(a) at each time, (N, n)."""
        return residual(self.plant, self.t, a * self.motion) - self.rest - a * self.parts.sum(axis=0)

    def nonlinear(self, a: float) -> Array:
        """|R(a)| at each time."""
        return size(self.mass, self.left(a))[0]

    def excess(self, a: float, share: float, rounding: float) -> Array:
        """The logarithm of |R(a)| against the share of the linear terms at each time; HUGE where the forces are no numbers."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return compare(self.nonlinear(a), share * a * self.linear, rounding)


@dataclass(frozen=True, eq=False)
class Along:
    """One linear motion over a period, with its terms at the nodes; `rounding`: of |R|."""

    plant: Linearization
    motion: LinearMotion
    nodes: Terms
    share: float
    rounding: float

    @classmethod
    def of(cls, plant: Linearization, motion: LinearMotion, share: float) -> "Along":
        nodes = Terms.along(plant, motion.t, np.concatenate([motion.starts, motion.ends[:, -1:]], axis=1))
        return cls(plant, motion, nodes, share, 4 * float(nodes.nonlinear(STILL).max()))

    def at(self, t: Array) -> Terms:
        """The terms at any times."""
        return Terms.along(self.plant, t, self.motion(t))

    def excess(self, t: Array, a: float) -> Array:
        """As `Terms.excess`, at any times."""
        return self.at(t).excess(a, self.share, self.rounding)

    def peaks(self, a: float) -> tuple[Array, Array]:
        """The times of the largest shares at an amplitude, and how much the logarithms there rose in the last look.

        They are sought where the terms at the nodes promise much, and where the coefficients are known to be narrow.
        """
        named = np.array(self.plant.features).reshape(-1, 2)
        t, width = (np.append(*parts) for parts in zip(self.estimate_peaks(a), named[:MOST].T, strict=True))
        found, rose = np.full(len(t), -np.inf), np.full(len(t), np.inf)
        for _ in range(ROUNDS):
            near = np.clip(t[:, None] + width[:, None] * np.linspace(-1, 1, LOOK), 0.0, self.motion.t[-1])
            excess = self.excess(near.ravel(), a).reshape(near.shape)
            best = excess.argmax(axis=1)[:, None]
            t, largest = np.take_along_axis(near, best, 1)[:, 0], np.take_along_axis(excess, best, 1)[:, 0]
            rose, found = largest - found, largest
            width = np.where(best[:, 0] % (LOOK - 1) > 0, 2 * width / (LOOK - 1), width)
        return t, np.abs(rose)

    def estimate_peaks(self, a: float) -> tuple[Array, Array]:
        """About where the shares are largest, and how closely that is known: between the nodes, forces are taken to be linear in time.

        A force that passes through zero does so nearly on a straight line, and there the share of what is left peaks.
        """
        root = np.linalg.cholesky(self.nodes.mass)
        with np.errstate(all="ignore"):
            left = np.nan_to_num(self.nodes.left(a), nan=np.inf)
        weighed = np.linalg.solve(root, np.moveaxis(np.array([*self.nodes.parts, left]), 0, -1))
        s = np.arange(WITHIN) / WITHIN
        with np.errstate(all="ignore"):
            inner = weighed[:-1, None] * (1 - s)[:, None, None] + weighed[1:, None] * s[:, None, None]
            sizes = np.linalg.norm(inner, axis=2).reshape(-1, 4)
        excess = compare(sizes[:, 3], self.share * a * sizes[:, :3].max(axis=1), self.rounding)
        steps = np.diff(self.motion.t)
        t = (self.motion.t[:-1, None] + steps[:, None] * s).ravel()
        around = np.pad(excess, 1, constant_values=-np.inf)
        higher = np.flatnonzero((excess >= around[:-2]) & (excess >= around[2:]))
        chosen = higher[np.argsort(excess[higher])[-PEAKS:]]
        return t[chosen], np.repeat(steps / WITHIN, WITHIN)[chosen]

    def thinned(self) -> "Along":
        """The same with the motion between every second node."""
        return replace(self, motion=self.motion.thinned())


@dataclass(frozen=True)
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

    __repr__ = represent

    @property
    def status(self) -> str:
        """What the smallest amplitude means."""
        worst, percent = int(np.argmin(self.amplitudes)), f"{100 * self.share:g} % of what it keeps"
        smallest, at = self.amplitudes[worst], self.leading[worst]
        where = f"{at.unit} in {at.title}"
        if not np.isfinite(smallest):
            return (
                f"the linear model serves for disturbances of up to {LARGEST:g} {where}, the largest tried: along the slowest modes "
                f"what it leaves out stays below {percent}"
            )
        if smallest == 0.0:
            return (
                f"what the linear model leaves out exceeds {percent} already at deflections of {SMALLEST:g} {where}: "
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
    instance("lin", lin, Linearization, "make one: fl.linearize(arm, motion, control)")
    positive("share", share)
    positive("tol", tol)
    system = lin.periodic_system()
    slow = slow_motions(system, modes, result, SAMPLES, lin.n)
    bare = plant or (lin if lin.control is None else linearize(lin.arm, lin.motion))
    motions = LinearMotion.of(system, lin.n, slow)
    largest = np.array([motion.largest for motion in motions])
    amplitudes, errors = largest * np.array([border(Along.of(bare, motion, share), tol) for motion in motions]).T
    leading = tuple(lin.coordinates[int(np.abs(motion.starts[0]).max(axis=0).argmax())] for motion in motions)
    return Validity(slow.directions / largest[:, None], amplitudes, share, leading, errors)


def border(along: Along, tol: float) -> tuple[float, float]:
    """The amplitude of a linear motion at which the nonlinear share is reached, and its error.

    It is sought at the times of the largest shares, and these at the amplitude that was found, until it falls no more.
    """
    t, rose = along.peaks(FIRST)
    found, before = search_border(along, t, tol), np.nan
    for _ in range(REPEATS):
        if found == 0.0:
            return found, SMALLEST
        more, rose = along.peaks(min(found, LARGEST))
        t = np.concatenate([t, more])
        before, found = found, search_border(along, more, tol)
        if found >= before * (1 - tol):
            break
        found = search_border(along, t, tol)
    return min(found, before), estimate_error(along, more, rose, min(found, before), tol)


def search_border(along: Along, t: Array, tol: float) -> float:
    """The smallest amplitude between SMALLEST and LARGEST that reaches the share at one of the times; 0 or inf beyond these."""
    terms = along.at(t)

    def excess(_: Array, logs: Array) -> Array:
        """Nearly linear in log a."""
        return np.array([terms.excess(float(a), along.share, along.rounding).max() for a in np.exp(logs)])

    low, high = np.log([SMALLEST]), np.log([LARGEST])
    at_low, at_high = excess(low, low), excess(high, high)
    if at_high[0] <= 0:
        return np.inf
    if at_low[0] > 0:
        return 0.0
    found = solve_brackets(excess, SignedEnds(low, high, at_low, at_high), max(tol, 1e-14))
    return float(np.exp(min(found.a[0], found.b[0])))


def estimate_error(along: Along, t: Array, rose: Array, amplitude: float, tol: float) -> float:
    """Of an amplitude at which the share is reached at one of the times: by how much the share there is uncertain, against its slope.

    It is what the last look at the peak changed, the rounding, and what the motion between every second node gives in its place.
    """
    if not 0.0 < amplitude < np.inf:
        return np.nan
    terms, coarse = along.at(t), along.thinned().excess(t, amplitude)
    excess, steeper = (terms.excess(a, along.share, along.rounding) for a in (amplitude, STEP * amplitude))
    k = int(excess.argmax())
    left = along.rounding / max(float(terms.nonlinear(amplitude)[k]), along.rounding)
    apart = float(rose[k]) + abs(float(coarse[k] - excess[k])) + left + SLOW_TOL
    slope = abs(float(steeper.max() - excess[k])) / np.log(STEP)
    return float(amplitude * (tol + min(apart / max(slope, apart), 1.0)))


def compare(nonlinear: Array, allowed: Array, rounding: float) -> Array:
    """The logarithm of the nonlinear terms, less their rounding, against what is allowed."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.log((nonlinear - rounding) / allowed)
    return np.where(nonlinear <= rounding, -HUGE, np.clip(np.nan_to_num(ratio, nan=HUGE), -HUGE, HUGE))


def size(M: Array, *forces: Array) -> Array:
    """sqrt(f' M^-1 f) of each force at each time: (forces, N)."""
    f = np.moveaxis(np.array(forces), 0, -1)
    return np.sqrt(np.einsum("tik,tik->kt", f, np.linalg.solve(M, f)))


def residual(plant: Linearization, t: Array, motion: Sequence[Array] | Array) -> Array:
    """The left side of the equations of motion, kept rows, at deviations y, y', y'' from the rigid motion."""
    return plant.about.of_arm("residual", t, *motion)[:, list(plant.kept), 0]
