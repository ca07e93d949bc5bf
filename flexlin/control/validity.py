"""How far the linear model is valid: where the nonlinear terms of the equations reach a stated share of the linear ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexlin.about.linear import linearize
from flexlin.about.linearization import Linearization
from flexlin.arguments import checked, instance
from flexlin.checks import Array, positive
from flexlin.control.slow_motions import slow_motions
from flexlin.mechanics.coordinates import Coordinate
from flexlin.periodic.boundary.roots import SignedEnds, solve_brackets
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.summary import represent

SAMPLES, CANDIDATES = 1024, 64
"""Times of a period among which the largest share is sought, at the least: where the linear terms all pass through small values
it peaks within a hundredth of a period; and how many of them a search looks at."""
LARGEST, SMALLEST = 10.0, 1e-7
"""Amplitudes between which the border is sought, in rad or m."""
REPEATS = 4
"""Searches among the times of largest share at the most."""
HUGE = 700.0
"""A logarithm beyond all numbers."""
STILL = 1e-14
"""An amplitude at which only rounding is left of the nonlinear terms."""


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

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.control.validity import Validity
    >>> plant = fl.linearize(fl.build_manipulator(scene := fl.load_scene("khang-2019")), scene.motion)
    >>> print(Validity(np.eye(4)[:2], np.array([0.2, 0.5]), 0.1, plant.coordinates).status.split(" along")[0])
    deflections below 0.2 rad in q1
    """

    directions: Array
    amplitudes: Array
    share: float
    leading: tuple[Coordinate, ...]

    __repr__ = represent

    @property
    def status(self) -> str:
        """What the smallest amplitude means."""
        worst, percent = int(np.argmin(self.amplitudes)), f"{100 * self.share:g} % of the linear ones"
        smallest, at = self.amplitudes[worst], self.leading[worst]
        where = f"{at.unit} in {at.name}"
        if not np.isfinite(smallest):
            return (
                f"along the slowest modes the nonlinear terms stay below {percent} for deflections up to {LARGEST:g} {where}, "
                "the largest tried"
            )
        if smallest == 0.0:
            return (
                f"the nonlinear terms exceed {percent} already at deflections of {SMALLEST:g} {where} along the slowest modes: "
                "the linear model holds nowhere here; trust the nonlinear simulation, or smooth what is abrupt (Coulomb friction)"
            )
        return (
            f"deflections below {smallest:.3g} {where} along the slowest modes keep the nonlinear terms below {percent}; "
            "a disturbance that is larger is a matter for the nonlinear simulation"
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
        Directions, amplitudes and what they mean.

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
    still = [np.zeros((len(slow.t), lin.n))] * 3
    resolved = bare.periodic_system().resolved
    assert isinstance(resolved, ResolvedCompanion)
    matrices, rest = resolved.sample(slow.t), residual(bare, slow.t, still)
    rates = np.einsum("tij,ktj->kti", system.resolved(slow.t), slow.states)
    along = [Terms.along(bare, slow.t, *motion, matrices, rest) for motion in zip(slow.states, rates, strict=True)]
    amplitudes = [border(terms, share, tol) for terms in along]
    leading = np.abs(slow.states[:, :, : lin.n]).max(axis=1).argmax(axis=1)
    return Validity(slow.directions, np.array(amplitudes), share, tuple(lin.coordinates[k] for k in leading))


@dataclass(frozen=True, eq=False)
class Terms:
    """A linear motion x = [y; y'] (N, 2n) in the equations: its linear terms by size (N,), and what is left beyond them."""

    plant: Linearization
    t: Array
    motion: tuple[Array, Array, Array]
    mass: Array
    slope: Array
    linear: Array
    rest: Array

    @classmethod
    def along(
        cls, plant: Linearization, t: Array, x: Array, rates: Array, matrices: tuple[Array, Array, Array], rest: Array
    ) -> "Terms":
        n, (M, D, K) = plant.n, matrices
        motion = (x[:, :n], x[:, n : 2 * n], rates[:, n : 2 * n])
        parts = [np.einsum("tij,tj->ti", matrix, z) for matrix, z in zip((K, D, M), motion, strict=True)]
        linear = np.max([size(M, part) for part in parts], axis=0)
        return cls(plant, t, motion, M, np.sum(parts, axis=0), linear, rest)

    def at(self, k: Array) -> "Terms":
        """The same at some of the times."""
        y, rate, acceleration = (z[k] for z in self.motion)
        arrays = (self.mass[k], self.slope[k], self.linear[k], self.rest[k])
        return Terms(self.plant, self.t[k], (y, rate, acceleration), *arrays)

    def nonlinear(self, a: float) -> Array:
        """|R(a)| at each time."""
        left = residual(self.plant, self.t, [a * z for z in self.motion])
        return size(self.mass, left - self.rest - a * self.slope)

    def excess(self, a: float, share: float, rounding: float) -> Array:
        """The logarithm of |R(a)| against the share of the linear terms at each time; HUGE where the forces are no numbers."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            nonlinear = self.nonlinear(a)
            ratio = np.log((nonlinear - rounding) / (share * a * self.linear))
        return np.where(nonlinear <= rounding, -HUGE, np.clip(np.nan_to_num(ratio, nan=HUGE), -HUGE, HUGE))


def border(terms: Terms, share: float, tol: float) -> float:
    """The amplitude of a linear motion at which the nonlinear share is reached.

    It is sought at CANDIDATES times first; then at those times of all at which the share is largest there, until these stay the same.
    """
    rounding, count = 4 * float(terms.nonlinear(STILL).max()), len(terms.t)
    found = search_border(terms.at(np.arange(0, count, max(1, count // CANDIDATES))), share, rounding, tol)
    for _ in range(REPEATS):
        if found == 0.0:
            break
        largest = np.argsort(terms.excess(min(found, LARGEST), share, rounding))[-CANDIDATES:]
        before, found = found, search_border(terms.at(largest), share, rounding, tol)
        if found >= before * (1 - tol):
            break
    return found


def search_border(terms: Terms, share: float, rounding: float, tol: float) -> float:
    """The smallest amplitude between SMALLEST and LARGEST that reaches the share somewhere; 0 or inf beyond these."""

    def excess(_: Array, logs: Array) -> Array:
        """Nearly linear in log a."""
        return np.array([terms.excess(float(a), share, rounding).max() for a in np.exp(logs)])

    low, high = np.log([SMALLEST]), np.log([LARGEST])
    at_low, at_high = excess(low, low), excess(high, high)
    if at_high[0] <= 0:
        return np.inf
    if at_low[0] > 0:
        return 0.0
    found = solve_brackets(excess, SignedEnds(low, high, at_low, at_high), max(tol, 1e-14))
    return float(np.exp(min(found.a[0], found.b[0])))


def size(M: Array, force: Array) -> Array:
    """sqrt(f' M^-1 f) at each time."""
    return np.sqrt(np.einsum("ti,ti->t", force, np.linalg.solve(M, force[:, :, None])[:, :, 0]))


def residual(plant: Linearization, t: Array, motion: Sequence[Array]) -> Array:
    """The left side of the equations of motion, kept rows, at deviations y, y', y'' from the rigid motion."""
    return plant.about.of_arm("residual", t, *motion)[:, list(plant.kept), 0]
