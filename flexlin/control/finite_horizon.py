"""The optimal time-varying feedback of a motion with an end."""

import numpy as np
from numpy.typing import ArrayLike

from flexlin.about.linearization import Linearization
from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.control.designed_loop import Design, Repeated, describe_gain
from flexlin.control.weights import constant_lqr
from flexlin.periodic.quadratic.linear_quadratic import linear_quadratic
from flexlin.periodic.quadratic.riccati import finite_horizon_riccati
from flexlin.periodic.system import MatrixFunction, PeriodicSystem, as_system


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
    system = as_system(system)
    final = cost_at_rest(system, Q, R, N) if end is None else end
    solution = finite_horizon_riccati(system, Q, R, final, N, tol)
    repeated = system.feedback(Repeated(solution.K, system.period), (0.0,))
    status = describe_gain(solution, solution.gain_error, tol)
    return Design(
        name, "finite-horizon-lqr", solution.K, repeated, solution.gain_error, status, solution.problem, solution
    )


def cost_at_rest(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None,
) -> Array:
    """Return the LQR cost of the coefficients at the end of the horizon."""
    problem, last = linear_quadratic(system, Q, R, N), np.array([system.period * (1 - 1e-12)])
    A, B, state, effort, cross = (f(last)[0] for f in (problem.A, problem.B, problem.Q, problem.R, problem.N))
    _, X = constant_lqr(A, B, state, effort, cross, "at the end of the horizon")
    return 0.5 * (X + X.T)
