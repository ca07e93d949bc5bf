"""The optimal periodic state feedback: its gain as one smooth series, and integral action."""

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import real_array
from flexlin.control.designed_loop import Design, describe_gain
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Constant, MatrixFunction
from flexlin.periodic.interpolation import FourierSeries, waves_at_nodes
from flexlin.periodic.quadratic.linear_quadratic import RiccatiSolution
from flexlin.periodic.quadratic.riccati import periodic_riccati, rough_places
from flexlin.periodic.related import extend_system
from flexlin.periodic.resolved.matrix import ResolvedMatrix, Series
from flexlin.periodic.resolved.resolve import resolve
from flexlin.periodic.resolved.sampling import RESOLVED
from flexlin.periodic.system import PeriodicSystem, as_system

SMOOTH = 64
"""Of the period: where coefficients change in a shorter time the gain has a series of its own."""
EPS = float(np.finfo(float).eps)
MOST_WAVES = 200
"""Harmonics of a gain that is made in one product."""
ROUNDED = 16 * EPS
"""What rounding makes of a gain by two Fourier transforms."""


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

    Where it is no product of Fourier series, it is resolved like any coefficient, as well as its own error allows.
    """
    rough = rough_places(solution.problem, system.period / SMOOTH)
    if not len(system.breaks) and not len(rough):
        transformed = transform_gain(solution)
        if transformed is not None:
            return transformed
    corners = np.union1d(system.breaks, rough)
    tol = max(RESOLVED, tol / 10, solution.gain_error)
    found = resolve(solution.K, system.period, corners.tolist(), complete=True, tol=tol)
    return found.series, float(found.error.max() / (np.abs(found.series.coefficients).max() or 1.0))


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


def transform_gain(solution: RiccatiSolution) -> tuple[FourierSeries, float] | None:
    """The gain of a smooth solution as the Fourier series that it is, where B is one too and R and N are constant; else None.

        K = R^-1 (B' X + N'),   as many harmonics as B and X have together

    Returns: the series, and what is left out and rounded, relative to the largest gain.
    """
    problem, X = solution.problem, solution.series
    B = problem.B.series if isinstance(problem.B, ResolvedMatrix) else problem.B
    if not isinstance(problem.R, Constant) or not isinstance(problem.N, Constant) or not isinstance(X, FourierSeries):
        return None
    if isinstance(B, Constant):
        B = FourierSeries(B.value[None], X.period)
    if not isinstance(B, FourierSeries) or X.degree + B.degree > MOST_WAVES:
        return None
    H = X.degree + B.degree
    count, effort = 2 * H + 1, np.linalg.inv(problem.R.value)
    values = (B.at_nodes(count) @ effort).swapaxes(1, 2) @ X.at_nodes(count) + effort @ problem.N.value.T
    rest = (values - values[0]).reshape(count, -1)  # constants are not rounded
    parts = (2 / count) * (waves_at_nodes(count, H).T @ rest)
    parts[0] *= 0.5
    size, heights = float(np.abs(values).max()) or 1.0, np.abs(parts).max(axis=1)
    left = np.append(np.maximum(heights[1 : H + 1], heights[H + 1 :])[::-1].cumsum()[::-1], 0.0)
    kept = int(np.count_nonzero(left > EPS * size))
    parts[0] += values[0].ravel()
    parts = np.concatenate([parts[: kept + 1], parts[H + 1 : H + 1 + kept]])
    return FourierSeries(parts.reshape(-1, *values.shape[1:]), X.period), float(left[kept] / size) + ROUNDED
