"""LQR gains of constant coefficients: averaged over a period, or frozen at phases of the motion and scheduled by phase."""

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.linalg import lapack

from flexlin.arguments import checked
from flexlin.checks import Array, check_size
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError, NumericalError
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.riccati.linear_quadratic import LinearQuadratic, linear_quadratic, refuse_mode
from flexlin.periodic.riccati.riccati import resolve_problem
from flexlin.periodic.system import MatrixFunction, PeriodicSystem

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
    if phases < 1:
        raise ArgumentError("no phases", got=phases, expected="at least 1")
    check_size(f"a schedule of {phases} phases", 32 * phases * system.n**2, "take fewer phases")
    problem = linear_quadratic(system, Q, R, N)
    knots = system.period * np.arange(phases) / phases
    gains = solve_frozen(problem, knots)[0]
    schedule: MatrixFunction = Constant(gains[0])
    if phases > 1:
        closed = np.concatenate([gains, gains[:1]])
        schedule = PeriodicSpline(np.append(knots, system.period), closed, bc_type="periodic")
    between = knots + 0.5 * system.period / phases
    missed = np.abs(schedule(between) - solve_frozen(problem, between)[0]).max() / (np.abs(gains).max() or 1.0)
    status = f"gain scheduled over {phases} phases, off by {missed:.1e} half-way between them; the verdict is Floquet's"
    loop = system.feedback(schedule, tuple(knots) if phases > 1 else ())
    return Design(name, "frozen-lqr", schedule, loop, float(missed), status, problem)


def solve_frozen(problem: LinearQuadratic, t: Array, when: str = "when frozen at t = {:.4g} s") -> tuple[Array, Array]:
    """The LQR gains (N, m, n) and costs (N, n, n) of the coefficients frozen at times t; when: how a message names the time."""
    frozen = zip(t, *(f(t) for f in (problem.A, problem.B, problem.Q, problem.R, problem.N)), strict=True)
    solved = [constant_lqr(A, B, Q, R, N, when.format(at)) for at, A, B, Q, R, N in frozen]
    return np.array([K for K, _ in solved]), np.array([X for _, X in solved])


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
    by_input, by_weight = (A, B / states[:, None], 1 / states, True), (A.T, (Q * states).T, states, False)
    for rates, matrix, units, unreached in (by_input, by_weight):
        matrix = matrix * (size / (float(np.linalg.norm(matrix, 2)) or 1.0))  # one margin serves both
        values, vectors = eig(rates, left=True, right=False)
        for s, w in zip(values, vectors.T, strict=True):
            if s.real < -1e-12 * size or not cancels(matrix.T, w.conj()):
                continue
            left, sizes, _ = np.linalg.svd(np.concatenate([s * np.eye(len(A)) - rates, matrix], axis=1))
            if sizes[-1] <= REACHED_SHARE * sizes[0]:
                vector = np.abs(left[:, -1] * units)
                direction = np.array2string(vector / vector.max(), precision=3, suppress_small=True)
                raise refuse_mode(unreached, f"eigenvalue {complex(s):.6g}, direction {direction}", f" {when}")


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
