"""The optimal state feedback of a periodic motion, of one with an end, and of constant coefficients: averaged, or frozen at phases."""

from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.linalg import lapack

from flexlin.arguments import checked
from flexlin.checks import Array, check_size, real_array
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable, NumericalError, ToleranceNotReached
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix, Series
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficient_series.sampling import RESOLVED_TOL
from flexlin.periodic.coefficients import Constant, MatrixFunction
from flexlin.periodic.riccati.linear_quadratic import LinearQuadratic, RiccatiSolution, linear_quadratic
from flexlin.periodic.riccati.riccati import finite_horizon_riccati, periodic_riccati, resolve_problem, rough_places
from flexlin.periodic.system import PeriodicSystem, as_system, extend_system

REACHED_SHARE = 1e-13
"""A mode counts as reached (or seen) when its share in B (or Q) is larger than this, relative to the matrices' sizes: than rounding."""
CANCELLED_SHARE = 1e-6
"""A share of this part of the terms that it sums is no rounding: the mode is reached, whatever the sizes of other modes."""


@checked
def averaged_lqr(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    name: str = "averaged LQR",
) -> Design:
    """Design one constant gain from the coefficients averaged over the period.

        A0 = 1/T int A dt, and so on;   A0' X + X A0 - (X B0 + N0) R0^-1 (B0' X + N0') + Q0 = 0,   u = -K x

    Assumes fast coefficients (averaging). Nothing guarantees a stable loop: look at its Floquet verdict.

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
    name : str
        Name of the design in reports.

    Returns
    -------
    Design
        A constant gain, which is exact: error 0.

    Raises
    ------
    ArgumentError
        When a weight does not fit.
    NotStabilizable, NotDetectable
        When the averaged problem has no solution; the message names eigenvalue and direction.

    References
    ----------
    Sanders, Verhulst, Murdock, Averaging Methods in Nonlinear Dynamical Systems (2007); `scipy.linalg.solve_continuous_are`.

    Examples
    --------
    An oscillator whose stiffness swings about zero:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> def stiffness(t):
    ...     return 0.5 * np.cos(10.0 * t)[:, None, None]
    >>> system = fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], stiffness, 0.2 * np.pi, B=[[1.0]])
    >>> design = fl.control.averaged_lqr(system, np.eye(2), np.eye(1))
    >>> design.K(np.zeros(1)).round(4)
    array([[[1.    , 1.7321]]])
    >>> fl.floquet(design.closed_loop).verdict
    'stable'
    """
    system = as_system(system)
    problem = linear_quadratic(system, Q, R, N)
    resolved, _ = resolve_problem(problem, system)
    A, B, state, effort, cross = map(mean, (resolved.A, resolved.B, resolved.Q, resolved.R, resolved.N))
    K, _ = constant_lqr(A, B, state, effort, cross, "on average")
    gain = Constant(K)
    status = "one constant gain for the averaged coefficients; the verdict is Floquet's"
    return Design(name, "averaged-lqr", gain, system.feedback(gain), 0.0, status, problem)


def mean(coefficient: MatrixFunction) -> Array:
    """The average of a coefficient over the period; of one that is handed out at all times as it is, itself."""
    if isinstance(coefficient, ResolvedMatrix | ResolvedCompanion):
        return coefficient.mean()
    return np.asarray(coefficient(np.zeros(1))[0])


class PeriodicSpline(CubicSpline):
    """The cubic spline of a period, which holds nothing narrow."""

    complete: ClassVar[bool] = True


@checked
def frozen_lqr(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    phases: int = 16,
    name: str = "frozen LQR",
) -> Design:
    """Schedule the LQR gains of a system frozen at equally spaced phases of its period.

        A(t_k)' X_k + X_k A(t_k) - (X_k B + N) R^-1 (B' X_k + N') + Q = 0,   K(t): periodic cubic spline through the K_k

    Assumes slow coefficients. Nothing guarantees a stable loop: look at its Floquet verdict.

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
    phases : int
        Number of frozen phases.
    name : str
        Name of the design in reports.

    Returns
    -------
    Design
        Its `error` is how far the schedule misses the frozen gain half-way between phases, relative to the largest gain.

    Raises
    ------
    ArgumentError
        When a weight does not fit, or there are no phases.
    NotStabilizable, NotDetectable
        When a frozen problem has no solution; the message names phase, eigenvalue and direction.

    References
    ----------
    Rugh, Shamma, Research on gain scheduling, Automatica 36 (2000) 1401; `scipy.linalg.solve_continuous_are`.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> def stiffness(t):
    ...     return (1.0 + 0.5 * np.cos(t))[:, None, None]
    >>> system = fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], stiffness, 2 * np.pi, B=[[1.0]])
    >>> design = fl.control.frozen_lqr(system, np.eye(2), np.eye(1), phases=8)
    >>> design.error < 1e-3, fl.floquet(design.closed_loop).verdict
    (True, 'stable')
    """
    system = as_system(system)
    if phases < 1:
        raise ArgumentError("no phases", got=phases, expected="at least 1")
    check_size(f"a schedule of {phases} phases", 32 * phases * system.n**2, "take fewer phases")
    problem = linear_quadratic(system, Q, R, N)
    knots = system.period * np.arange(phases) / phases
    gains = frozen_gains(problem, knots)
    schedule: MatrixFunction = Constant(gains[0])
    if phases > 1:
        closed = np.concatenate([gains, gains[:1]])
        schedule = PeriodicSpline(np.append(knots, system.period), closed, bc_type="periodic")
    between = knots + 0.5 * system.period / phases
    missed = np.abs(schedule(between) - frozen_gains(problem, between)).max() / (np.abs(gains).max() or 1.0)
    status = f"gain scheduled over {phases} phases, off by {missed:.1e} half-way between them; the verdict is Floquet's"
    loop = system.feedback(schedule, tuple(knots) if phases > 1 else ())
    return Design(name, "frozen-lqr", schedule, loop, float(missed), status, problem)


def frozen_gains(problem: LinearQuadratic, t: Array) -> Array:
    """Return the LQR gains of the coefficients frozen at times t, (N, m, n)."""
    frozen = zip(t, *(f(t) for f in (problem.A, problem.B, problem.Q, problem.R, problem.N)), strict=True)
    when = "when frozen at t = {:.4g} s"
    return np.array([constant_lqr(A, B, Q, R, N, when.format(at))[0] for at, A, B, Q, R, N in frozen])


def check_constant_pair(A: Array, B: Array, Q: Array, when: str) -> None:
    """Refuse a constant problem with a mode that does not decay and that the input does not reach or the weight does not see.

    A mode with eigenvalue s, Re s >= 0, is reached when [s I - A, B] has full rank, seen when [s I - A; Q] has (Hautus). Where
    far faster modes hide the rank, it is reached when its left vector w does not cancel in w^H B, seen when its right one does not in
    Q v. The states are scaled so that rows and columns of A have like sizes (balancing), which leaves both ranks as they are.
    Raises: NotStabilizable, NotDetectable, naming the eigenvalue and the mode's direction.
    """
    from scipy.linalg import eig  # takes longer to load than other designs to compute

    A, _, _, states, _ = lapack.dgebal(A, scale=1, permute=0)
    size = float(np.linalg.norm(A, 2)) or 1.0
    unreached = NotStabilizable, "cannot be reached by the input", "add an actuator that moves it"
    unseen = NotDetectable, "is not seen by the weight Q", "give the mode's states weight in Q"
    by_input, by_weight = (A, B / states[:, None], 1 / states, *unreached), (A.T, (Q * states).T, states, *unseen)
    for rates, matrix, units, kind, what, todo in (by_input, by_weight):
        matrix = matrix * (size / (float(np.linalg.norm(matrix, 2)) or 1.0))  # one margin serves both
        values, vectors = eig(rates, left=True, right=False)
        for s, w in zip(values, vectors.T, strict=True):
            if s.real < -1e-12 * size or not cancels(matrix.T, w.conj()):
                continue
            left, sizes, _ = np.linalg.svd(np.concatenate([s * np.eye(len(A)) - rates, matrix], axis=1))
            if sizes[-1] <= REACHED_SHARE * sizes[0]:
                vector = np.abs(left[:, -1] * units)
                direction = np.array2string(vector / vector.max(), precision=3, suppress_small=True)
                got = f"eigenvalue {complex(s):.6g}, direction {direction}"
                raise kind(f"a mode that does not decay {what} {when}", got=got, todo=todo)


def cancels(matrix: Array, vector: Array) -> bool:
    """Whether every entry of a product with a vector is next to nothing beside the terms that it sums."""
    return bool(np.all(np.abs(matrix @ vector) <= CANCELLED_SHARE * (np.abs(matrix) @ np.abs(vector))))


def constant_lqr(A: Array, B: Array, Q: Array, R: Array, N: Array, when: str) -> tuple[Array, Array]:
    """Return the LQR gain K and cost X of constant matrices, once the loop that they make has been found stable.

        A' X + X A - (X B + N) R^-1 (B' X + N') + Q = 0,   K = R^-1 (B' X + N')

    SciPy's solver is the one that python-control calls, without the second that it takes to load python-control.
    Raises: NotStabilizable, NotDetectable as `check_constant_pair`; NumericalError where rounding leaves no stable loop.
    """
    from scipy.linalg import solve_continuous_are

    check_constant_pair(A, B, Q, when)
    growth = np.inf
    try:
        X = solve_continuous_are(A, B, Q, R, s=N)
        K = np.linalg.solve(R, B.T @ X + N.T)
        growth = float(np.linalg.eigvals(A - B @ K).real.max())
        why = f"a loop that grows by {growth:.3g} 1/s"
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        why = str(error)
    if not growth < 0:
        todo = "bring states, inputs and weights to like sizes, or leave out the fastest modes"
        raise NumericalError(
            f"the Riccati equation has no stabilising solution in numbers of this precision {when}", got=why, todo=todo
        )
    return K, X


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
    system = as_system(system)
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
    system = as_system(system)
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
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
    system = as_system(system)
    final = cost_at_rest(system, Q, R, N) if end is None else end
    solution = finite_horizon_riccati(system, Q, R, final, N, tol)
    repeated = system.feedback(partial(repeat, solution.K, system.period), (0.0,))
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
