"""One constant LQR gain for the average of the coefficients over a period."""

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.control.designed_loop import Design
from flexlin.control.weights import constant_lqr
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.quadratic.linear_quadratic import linear_quadratic
from flexlin.periodic.quadratic.resolution import resolve_problem
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.system import MatrixFunction, PeriodicSystem, as_system


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
