"""Periodic motions of the elastic arm: which one is sought, what is handed back, and linearization about it."""

from functools import lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, at_times, positive
from flexlin.errors import MotionError, NumericalError, ToleranceNotReached
from flexlin.linearization.deviation import Deviation, differentiate, loop_expressions
from flexlin.linearization.harmonic_balance import (
    Closing,
    Solver,
    balance,
    by_law,
    lost,
    miss_between,
    passes_unseen,
    size_of,
)
from flexlin.linearization.law import Law
from flexlin.linearization.layers import Layers
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.interpolation import FourierSeries
from flexlin.periodic.system import PeriodicSystem, extend_system
from flexlin.precision import SLIGHT
from flexlin.summary import immutable
from flexlin.symbolic import Part


def continue_in_speed(solver: Solver) -> Array:
    """The solution under an exact closing at full speed, followed from rest: s'' and s' count for little at first.

        F(y, sigma y', sigma^2 y'', torque; q, sigma q', sigma^2 q'') = 0,   sigma from 0 to 1

    Raises: NumericalError naming the speed that was reached, and why it goes no further.
    Source: Allgower, Georg, Introduction to Numerical Continuation Methods (2003), ch. 2.
    """
    found = solver.solve(None, 0.0)
    if found is None:
        raise lost(
            "Newton's method did not settle, nor does it for the arm at rest in the places of its path",
            "stiffen the links or lighten the load: gravity alone bends them too far",
        )
    passed, step = [(0.0, found[0])], 0.5
    while passed[-1][0] < 1.0:
        if step < SLIGHT:
            raise refuse(solver, passed)
        reached, z = passed[-1]
        trial = min(1.0, reached + step)
        found = solver.solve(z, trial)
        step = step / 2 if found is None else 2 * step
        passed += [] if found is None else [(trial, found[0])]
    return passed[-1][1]


def refuse(solver: Solver, passed: list[tuple[float, Array]]) -> NumericalError:
    """What ended the branch, from the speeds that were passed and their solutions."""
    about, (reached, z) = solver.about, passed[-1]
    deviation = np.abs(z[:, : about.n]).max(axis=0)
    worst = int(np.argmax(deviation))
    where = about.arm.coordinates[about.kept[worst]]
    far = f"the largest deviation there is {deviation[worst]:.3g} {where.unit} in {where.name}"
    got = f"followed from rest, Newton's method ends at {reached:.3g} of the speed; {far}"
    return explain(
        got, f"move at most {reached:.2g} times as fast, or lower the amplitude", *find_singular(solver, passed)
    )


def explain_loss(solver: Solver, start: Array) -> NumericalError:
    """What to say where a solution on fewer points, at the times of the solver, leads to none."""
    got, rest = f"Newton's method did not settle on {solver.points} points", solver.solve(None, 0.0)
    passed = [] if rest is None else [(0.0, rest[0])]
    todo = "slow the motion down, lower its amplitude or stiffen the links"
    return explain(got, todo, *find_singular(solver, [*passed, (1.0, start)]))


def explain(got: str, todo: str, speed: float, t: float | None) -> NumericalError:
    """The error, with the speed from which on the inverse is singular and the time, if it is."""
    if t is None:
        return lost(got, todo)
    since = f"from {speed:.3g} of it on" if speed > 0 else "at any speed"
    todo = f"move at most {speed:.2g} times as fast, lower the amplitude, or stiffen the links"
    other = "use joint-exact, give the links fewer modes, or choose a path that stays away from there"
    return lost(f"{got}; {since} {describe_singular(t)}", todo if speed > 0 else other)


def find_singular(solver: Solver, passed: list[tuple[float, Array]]) -> tuple[float, float | None]:
    """The speed from which on the inverse is singular somewhere, by bisection, and the time; none where it never is."""
    times = [solver.singular_time(z) for _, z in passed]
    first = next((i for i, t in enumerate(times) if t is not None), None)
    if not first:
        return 0.0, None if first is None else times[0]
    (low, z), high, t = passed[first - 1], passed[first][0], times[first]
    while high - low > SLIGHT:
        middle = 0.5 * (low + high)
        found = solver.solve(z, middle)
        at = None if found is None else solver.singular_time(found[0])
        if found is not None and at is None:
            low, z = middle, found[0]
        else:
            high, t = middle, t if at is None else at
    return high, t


def describe_singular(t: float) -> str:
    """Why an exact closing may have no smooth solution."""
    where = f"the arm's inertia, its tip held on its line, is singular about t = {t:.3g} s"
    return f"{where}: accelerations and torque are not determined there"


COARSEST_INTERVALS, POINT_SETS = 32, 5
"""Harmonic balance begins with one point more than this, and tries so many sets of points, each with twice the intervals."""
SOFTER = "let friction saturate at a larger rate (effects.coulomb_friction.rate), or simulate the arm until its motion repeats"


@immutable(eq=False)
class PeriodicMotion:
    """A periodic solution s = s_R + y of M s'' + C s' + g + d = B torque.

    Call it with times (N,) to get y (N, n), or with one time to get y (n,).

    Attributes
    ----------
    lin : Linearization
        The equations and their rigid motion.
    y : FourierSeries
        The deviation from the rigid motion, in rad or m.
    torque : FourierSeries
        The torque (N, m) that drives it, in N m.
    error : float
        Difference to the solution on half as many points, relative to the largest |y| (at least 1e-6); where friction changes its sign
        between the points, at least what that would move.
    status : str
        What to make of it.
    controller : FourierSeries
        The states z (N, k) of the law's controller.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> motion = fl.control.periodic_motion(lin)
    >>> motion(0.3).shape, motion.state([0.0, 0.3]).shape
    ((3,), (2, 6))
    >>> bool(np.allclose(motion(0.3), motion(0.3 + lin.period), atol=1e-12))
    True
    """

    lin: Linearization
    y: FourierSeries
    torque: FourierSeries
    error: float
    status: str
    controller: FourierSeries

    def __call__(self, t: ArrayLike) -> Array:
        return at_times(self.y, t)

    def rate(self, t: ArrayLike) -> Array:
        """Return the rate y' of the deviation.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n) or (n,)
            y', in rad/s or m/s.
        """
        return at_times(lambda t: self.y(t, 1), t)

    def acceleration(self, t: ArrayLike) -> Array:
        """Return the acceleration y'' of the deviation.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n) or (n,)
            y'', in rad/s^2 or m/s^2.
        """
        return at_times(lambda t: self.y(t, 2), t)

    def state(self, t: ArrayLike) -> Array:
        """Return the deviation and its rate.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, 2n) or (2n,)
            [y; y'].
        """
        return at_times(lambda t: np.concatenate([self.y(t), self.y(t, 1)], axis=1), t)

    def loop_state(self, t: ArrayLike) -> Array:
        """Return the state of the whole loop.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, 2n + k) or (2n + k,)
            [y; y'; z].
        """
        return at_times(lambda t: np.concatenate([self.state(t), self.controller(t)], axis=1), t)


@checked
def periodic_motion(
    lin: Linearization, closing: Closing | None = None, tol: float = 1e-8, linear: bool = False, law: Law | None = None
) -> PeriodicMotion:
    """Find the periodic motion of the elastic arm that a control law, or another closing condition, singles out.

        M(s) s'' + C s' + g + d = B torque,   closing(y, y', torque, t) = 0,   s = s_R + y,   y(t + T) = y(t)

    y and torque are trigonometric polynomials; the equations hold at N equally spaced times (Newton's method on all at once).
    As a boundary value problem it does not mind unstable modes, of the plant or of its zeros. Where Newton's method finds no motion for a
    closing condition, it is followed in speed from the arm at rest; if that ends too, the error names the speed and the reason.
    Assumes a smooth motion: at a jump of q''' the series converges slowly, which the error shows. So it does where friction changes its
    sign in less time than lies between two points.

    Parameters
    ----------
    lin : Linearization
        Of a periodic motion, with n coordinates and m inputs.
    closing : callable, optional
        (Deviation, Unknowns) -> casadi.SX (m, 1) that is to vanish; by default the torque obeys the law.
    tol : float
        Wanted `error`, relative to the largest |y|.
    linear : bool
        Stop after one Newton step from the rigid motion: the answer of the linearization.
    law : Law, optional
        The control law; by default `lin.law`.

    Returns
    -------
    PeriodicMotion
        y(t), its rates, the torque and an error.

    Raises
    ------
    MotionError
        For a one-way motion.
    NumericalError
        When Newton's method fails.
    ToleranceNotReached
        When 513 points leave an error above 1 %.

    References
    ----------
    Krack, Gross, Harmonic Balance for Nonlinear Vibration Problems (2019), ch. 2.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> motion = fl.control.periodic_motion(lin, tol=1e-6)
    >>> motion.error < 1e-6
    True
    """
    positive("tol", tol)
    if not lin.motion.periodic:
        raise MotionError("a one-way motion has no periodic solution", todo="use course = 'there-and-back'")
    law = law or lin.law
    law = law if closing is None else law.direct
    equations = balance(lin.about, closing or by_law, law.controller)
    before, layers = None, None if linear else Layers.of(lin.about)
    tried = [COARSEST_INTERVALS * 2**k + 1 for k in range(POINT_SETS)]
    for points in tried:
        solver = Solver(lin.about, equations, law, points)
        try:
            values, left = find_values(solver, closing is not None, linear, before)
        except NumericalError:
            if layers is None or before is None or not passes_unseen(layers, before, points):
                raise
            raise lost(f"{points} points are too few for the time in which friction changes its sign", SOFTER) from None
        parts = np.split(values, [lin.n, lin.n + lin.about.m], axis=1)
        y, torque, z = (FourierSeries.through(part, lin.period) for part in parts)
        if before is not None:
            error = max(distance(y, before), left)
            if layers is not None and (error <= tol or points == tried[-1]):
                error = max(error, miss_between(solver, layers, values))
            if error <= tol:
                return PeriodicMotion(lin, y, torque, error, f"converged on {points} points", z)
        before = FourierSeries.through(values, lin.period)
        singular = solver.singular_time(values) if points > SAMPLES and closing is not None and not linear else None
        if singular is not None:
            break
    why = "the motion is not smooth" if singular is None else describe_singular(singular)
    if error > 0.01:
        raise ToleranceNotReached(
            "the periodic motion is not resolved",
            got=f"error {error:.2g} on {points} points: {why}",
            expected=f"at most {tol:.2g}",
            todo="use a smoother basic motion" + ("" if singular is None else ", joint-exact, or fewer modes"),
        )
    todo = "choose a smoother one, or a tol above this error"
    status = f"error {error:.1e} above tol {tol:.0e} on {points} points: {why}; {todo}"
    return PeriodicMotion(lin, y, torque, error, status, z)


def find_values(solver: Solver, exact: bool, linear: bool, before: FourierSeries | None) -> tuple[Array, float]:
    """The unknowns (N, n + m + k), and the last step of Newton's method relative to |y|; exact closings are followed from rest if need be.

    Raises: NumericalError where there is no solution.
    """
    if linear:
        return solver.step(np.zeros((solver.points, solver.size)))[0], 0.0
    t = solver.given[0]
    start = None if before is None else before(t)
    found = solver.solve(start)
    if found is not None:
        return found
    if exact and start is None:
        return continue_in_speed(solver), 0.0
    if start is None or not exact:
        raise lost(f"Newton's method did not settle on {solver.points} points")
    raise explain_loss(solver, start)


def distance(y: FourierSeries, coarse: FourierSeries) -> float:
    """The largest difference to a coarser solution, relative to the largest |y|; only the coordinates that y has count."""
    points, n = y.coefficients.shape
    t = y.period * np.arange(2 * points) / (2 * points)
    return float(np.abs(y(t) - coarse(t)[:, :n]).max() / size_of(y(t[::2])))


def sample_slopes(motion: PeriodicMotion, names: str, t: Array) -> Any:
    """Some of M, D, K, B about a periodic motion of the elastic arm at times (N,), in one mapped call; one alone as it is."""
    along = motion.y(t), motion.y(t, 1), motion.y(t, 2), motion.torque(t)
    found = motion.lin.about.evaluate(Part(slopes(motion.lin.about), tuple(names)), t, *along)
    return found if len(names) > 1 else found[0]


@checked
def linearize_about(motion: PeriodicMotion, closed: bool = True) -> PeriodicSystem:
    """Linearize the equations about a periodic motion of the elastic arm itself.

        M z'' + D z' + K z = B u,   M = d r/d s'',  D = d r/d s',  K = d r/d s,   r = M(s) s'' + C s' + g + d - B(s) torque

    at s = s_R + y of the motion. The motion solves the equations, so nothing is left over on the right side (h = 0), and where
    the links are bent D is not zero even for a single link.

    Parameters
    ----------
    motion : PeriodicMotion
        From `periodic_motion` or from a feedforward.
    closed : bool
        With the scene's feedback, else the arm alone.

    Returns
    -------
    PeriodicSystem
        The system of [z; z'], followed by the states of the loop's controller, with input u the torque beside the motion's.

    Raises
    ------
    SingularMassMatrix
        When M cannot be inverted.

    References
    ----------
    Khang, Dat, Tuan (2019), section 4, with the elastic motion as basic motion.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> elastic = fl.control.linearize_about(fl.control.periodic_motion(lin, tol=1e-6))
    >>> fl.floquet(elastic, tol=1e-6).verdict
    'stable'
    """
    lin = motion.lin
    M, D, K, B = (partial(sample_slopes, motion, name) for name in "MDKB")
    equations = partial(sample_slopes, motion, "MDK")
    system = PeriodicSystem.from_second_order(M, D, K, lin.period, B, lin.breaks, equations)
    law = lin.law
    if not closed:
        return system
    open_loop = system if law.controller is None else extend_system(system, law.controller.rates)
    return open_loop.feedback(law.gain)


@lru_cache(maxsize=8)
def slopes(about: Deviation) -> ca.Function:
    """M, D, K, B about s = s_R + y, as functions of y, y', y'', torque and the place on the motion; kept for the next run."""
    inputs, angles, F, _ = loop_expressions(about)
    return about.function(angles, inputs, differentiate(F, inputs))
