"""The optimal state feedback of a periodic motion, its gain one smooth series, and of a motion with an end; integral action."""

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, real_array
from flexlin.control.designed_loop import Design
from flexlin.control.frozen import solve_frozen
from flexlin.errors import ToleranceNotReached
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficient_series.matrix import Series
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficient_series.sampling import RESOLVED_TOL
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.riccati.linear_quadratic import RiccatiSolution, linear_quadratic
from flexlin.periodic.riccati.riccati import finite_horizon_riccati, periodic_riccati, rough_places
from flexlin.periodic.system import PeriodicSystem, extend_system, input_of

SMOOTH_PARTS = 64
"""Of the period: where coefficients change in a shorter time the gain has a series of its own."""


@checked
def periodic_lqr(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
    name: str = "periodic LQR",
) -> Design:
    """Design the state feedback that minimises a quadratic cost along a periodic motion.

        u = -K(t) x,   K = R^-1 (B' X + N'),   -X' = A' X + X A - (X B + N) R^-1 (B' X + N') + Q,   X(t + T) = X(t)

    minimises the integral of x' Q x + 2 x' N u + u' R u. Assumes (A, B) stabilisable, (Q, A) detectable, and coefficients that are
    smooth between the system's breaks.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs.
    Q : array_like (n, n), or function of times (N,) -> (N, n, n)
        Weight of the states.
    R : array_like (m, m), or function of times (N,) -> (N, m, m)
        Weight of the inputs.
    N : array_like (n, m), or function of times (N,) -> (N, n, m), optional
        Weight of products of states and inputs.
    tol : float
        Wanted relative error of X.
    name : str
        Name of the design in reports.

    Returns
    -------
    Design
        K(t) and X(t) at any t, the closed loop, cost(x0), error and status.

    Raises
    ------
    ArgumentError
        When a weight does not fit.
    NotStabilizable, NotDetectable
        When a mode that does not decay is not reached by the input, or not seen by the weight.
    ToleranceNotReached
        When X misses tol by far, or no digit of K is known.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems: Filtering and Control (2009), ch. 6.

    Examples
    --------
    For a double integrator with unit weights the gain is known, [1, sqrt(3)]:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> design = fl.periodic_lqr(system, np.eye(2), np.eye(1))
    >>> design.K(np.zeros(1)).round(8).tolist()
    [[[1.0, 1.73205081]]]
    >>> design.error < 1e-9, fl.floquet(design.closed_loop).verdict
    (True, 'stable')
    """
    solution = periodic_riccati(system, Q, R, N, tol)
    gain, apart = represent_gain(solution, system, tol)
    error = float(solution.gain_error + apart)
    status = describe_gain(solution, error, tol)
    return Design(name, "periodic-lqr", gain, system.feedback(gain), error, status, solution.problem, solution)


def represent_gain(solution: RiccatiSolution, system: PeriodicSystem, tol: float) -> tuple[Series, float]:
    """The gain as one series, and its deviation from the solution's relative to the largest gain.

    It is resolved like any coefficient, as well as its own error allows.
    """
    corners = np.union1d(system.breaks, rough_places(solution.problem, system.period / SMOOTH_PARTS))
    tol = max(RESOLVED_TOL, tol / 10, solution.gain_error)
    found = resolve(solution.K, system.period, corners.tolist(), complete=True, tol=tol)
    return found.series, float(found.error.max() / (np.abs(found.series.coefficients).max() or 1.0))


def describe_gain(solution: RiccatiSolution, error: float, tol: float) -> str:
    """The solution's status, or what makes the gain less certain than X.

    Raises: ToleranceNotReached where nothing of the gain is known.
    """
    if error >= 1:
        raise ToleranceNotReached(
            "no digit of the gain is known",
            got=f"error {solution.error:.1g} of X, {error:.1g} of K = R^-1 (B' X + N')",
            expected=f"at most {tol:.1g}",
            todo="bring states, inputs and weights to like sizes: R is small beside B' X B",
        )
    if error <= max(tol, solution.error):
        return solution.status
    return (
        f"X has converged to {solution.error:.1g}, which K = R^-1 (B' X + N') amplifies: error {error:.1g} of the gain "
        f"above the asked {tol:.1g}; ask for tol={2 * error:.0e}"
    )


@checked
def with_integral_action(system: PeriodicSystem, measured: ArrayLike) -> PeriodicSystem:
    """Extend a system by the integrals of measured errors, so that any design on it acts on them too.

        [x; e]' = [[A, 0], [C, 0]] [x; e] + [B; 0] u

    An LQR for it, u = -K_x x - K_e e, leaves no mean error of C x behind a constant disturbance of the torque.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and an input.
    measured : array_like, shape (p, n)
        C, such as the rows of the joint angles.

    Returns
    -------
    PeriodicSystem
        The system of n + p states.

    Raises
    ------
    ArgumentError
        When C does not fit or the system has no input.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> fl.control.with_integral_action(system, [[1.0, 0.0]]).A([0.0])[0].tolist()
    [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    """
    input_of(system)
    C = real_array("measured", measured, (None, system.n))
    return extend_system(system, np.hstack([C, np.zeros((len(C), len(C)))]))


@checked
def horizon_system(lin: Linearization) -> PeriodicSystem:
    """Return the linear system of a motion from start to end; its period is the duration of the motion.

        M_L y'' + D_L y' + K_L y = B_L u,   0 <= t <= T

    Use it with `finite_horizon_lqr`. Repeated beyond T it means nothing unless the motion is periodic. For the transition into rest
    choose a long enough motion (a dwell at its end), since the gain after T is that of the arm at rest.

    Parameters
    ----------
    lin : Linearization
        Of a one-way or a periodic motion.

    Returns
    -------
    PeriodicSystem
        The system in x = [y; y'], with the coefficients of the second-order equations.

    Raises
    ------
    SingularMassMatrix
        When M_L cannot be inverted.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("pick-and-place", {"motion.course": "one-way"})
    >>> system = fl.control.horizon_system(fl.linearize(fl.build_manipulator(scene), scene.motion))
    >>> system.n, system.m, system.period
    (10, 2, 1.0)
    """
    return PeriodicSystem.from_second_order(
        lin.M, lin.D, lin.K, lin.period, lin.B if lin.driven else None, lin.breaks, lin.equations
    )


def repeat(gain: MatrixFunction, period: float, t: Array) -> Array:
    """A function of one period or horizon, repeated."""
    return gain(np.mod(t, period))


@checked
def finite_horizon_lqr(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    end: ArrayLike | None = None,
    tol: float = 1e-9,
    name: str = "finite-horizon LQR",
) -> Design:
    """Design the feedback that is optimal over a horizon [0, T].

        -X' = A' X + X A - (X B + N) R^-1 (B' X + N') + Q,   X(T) = end,   u = -R^-1 (B' X + N') x

    The cost ends with x(T)' end x(T). With end = None the cost after T is that of the LQR for the coefficients at rest at T, so the
    gain goes over into it.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs; its period is the horizon T in s.
    Q : array_like (n, n), or function of times (N,) -> (N, n, n)
        Weight of the states.
    R : array_like (m, m), or function of times (N,) -> (N, m, m)
        Weight of the inputs.
    N : array_like (n, m), or function of times (N,) -> (N, n, m), optional
        Weight of products of states and inputs.
    end : array_like, shape (n, n), optional
        Cost at T, symmetric positive semidefinite.
    tol : float
        Wanted relative error of X.
    name : str
        Name of the design in reports.

    Returns
    -------
    Design
        K(t) and X(t) hold for 0 <= t <= T. The closed loop repeats the horizon: a Floquet verdict on it answers for a motion that
        is repeated.

    Raises
    ------
    ArgumentError
        When a weight does not fit.
    NotStabilizable, NotDetectable
        When the problem at the end of the horizon has no solution.
    ToleranceNotReached
        When X misses tol by far, or no digit of K is known.

    References
    ----------
    Anderson, Moore, Optimal Control: Linear Quadratic Methods (1990), ch. 2-3.

    Examples
    --------
    For x' = u with unit weights and no cost at the end, X = tanh(T - t):

    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0]], 1.0, B=[[1.0]])
    >>> design = fl.control.finite_horizon_lqr(system, [[1.0]], [[1.0]], end=[[0.0]])
    >>> print(f"{design.X(0.25).item():.8f} {np.tanh(0.75):.8f}")
    0.63514895 0.63514895
    """
    if end is None:
        last = np.array([system.period * (1 - 1e-12)])
        (X,) = solve_frozen(linear_quadratic(system, Q, R, N), last, "at the end of the horizon")[1]
        end = 0.5 * (X + X.T)
    solution = finite_horizon_riccati(system, Q, R, end, N, tol)
    repeated = system.feedback(partial(repeat, solution.K, system.period), (0.0,))
    status = describe_gain(solution, solution.gain_error, tol)
    return Design(
        name, "finite-horizon-lqr", solution.K, repeated, solution.gain_error, status, solution.problem, solution
    )
