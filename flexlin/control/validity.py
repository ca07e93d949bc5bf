"""How far the linear model is valid: where the nonlinear terms of the equations reach a stated share of the linear ones."""

from dataclasses import dataclass

import numpy as np

from flexlin.about.linear import linearize
from flexlin.about.linearization import Linearization
from flexlin.arguments import checked, instance
from flexlin.checks import SAMPLES, Array, positive
from flexlin.control.nonlinear_share import Along
from flexlin.control.slow_motions import SLOW_TOL, LinearMotion, slow_motions
from flexlin.mechanics.coordinates import Coordinate
from flexlin.periodic.floquet.result import FloquetResult
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
