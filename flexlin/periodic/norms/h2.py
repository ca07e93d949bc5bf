"""The H2 norm of a periodic system, by its periodic Lyapunov equation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import SAMPLES, Array, positive
from flexlin.errors import ArgumentError, counted
from flexlin.periodic.coefficients import MatrixFunction, as_matrix_function, check_samples, has_nothing_narrow
from flexlin.periodic.fourier import fourier_nodes
from flexlin.periodic.grid import divide_segments
from flexlin.periodic.precision import EPS, MINOR
from flexlin.periodic.quadratic.linear_quadratic import RiccatiSolution
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.panels import MOST_PANELS, NODES
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import represent


@dataclass(frozen=True)
class H2Norm:
    """The H2 norm and a bound on its error, in units of the output per root of the unit of white noise on the inputs.

    Attributes
    ----------
    value : float
        The norm.
    error : float
        Of the value.

    Examples
    --------
    >>> import flexlin as fl
    >>> print(f"{fl.h2_norm(fl.PeriodicSystem([[-2.0]], 1.0, B=[[1.0]]), [[1.0]]).value:.6f}")
    0.500000
    """

    value: float
    error: float

    __repr__ = represent


def h2_norm(system: PeriodicSystem, C: MatrixFunction | ArrayLike, tol: float = 1e-10) -> H2Norm:
    """Compute the H2 norm of x' = A x + B u, y = C x.

        |G|^2 = (1/T) int_0^T trace(B' X B) dt,   -X' = A' X + X A + C' C

    the mean power of y under white noise of unit intensity on every input. Assumes a stable system without feedthrough.

    Parameters
    ----------
    system : PeriodicSystem
        With inputs; n states, m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        The output matrix.
    tol : float
        Wanted accuracy of X, relative to its largest entry.

    Returns
    -------
    H2Norm
        value and error.

    Raises
    ------
    ArgumentError
        When the system has no input or C does not fit.
    NotStable
        When the system is not stable.
    ToleranceNotReached
        When X misses tol by far.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), section 9.1.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.5]], 1.0, B=[[0.0], [1.0]])
    >>> print(f"{fl.h2_norm(system, [[1.0, 0.0]]).value:.6f}")
    1.000000
    """
    output = check_ports(system, C)[1]
    B = system.resolved_input
    solution = periodic_lyapunov(system, Squares(output), MINOR * positive("tol", tol))
    square, quadrature = mean_power(solution, B)
    t = fourier_nodes(SAMPLES, system.period)
    X, reached = np.abs(solution.X(t)), np.abs(B(t)).sum(axis=1)
    doubt = solution.error * float(X.max()) * float((reached**2).sum(axis=1).mean()) + quadrature
    value = float(np.sqrt(max(square, 0.0)))
    return H2Norm(value, float(doubt / (2 * value) if value**2 > doubt else np.sqrt(abs(square) + doubt)))


@dataclass(frozen=True, eq=False)
class Squares:
    """C' C as a function of time, as complete as C."""

    matrix: MatrixFunction

    def __call__(self, t: Array) -> Array:
        values = self.matrix(t)
        return np.swapaxes(values, 1, 2) @ values

    @property
    def complete(self) -> bool:
        return has_nothing_narrow(self.matrix)


def mean_power(solution: RiccatiSolution, B: ResolvedMatrix) -> tuple[float, float]:
    """The mean of trace(B' X B) and what is lost in it."""

    def power(t: Array) -> Array:
        reached = B(t)
        return np.einsum("tki,tkl,tli->t", reached, solution.X(t), reached)

    return mean_of_parts(power, np.union1d(solution.edges, B.edges))


def check_ports(system: PeriodicSystem, C: MatrixFunction | ArrayLike) -> tuple[MatrixFunction, MatrixFunction]:
    """Return B and C as functions of time. Raises: ArgumentError where there is no input or C does not fit."""
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
    output = as_matrix_function("C", C)
    columns = check_samples("C", output, system.period).shape[2]
    if columns != system.n:
        raise ArgumentError("C does not fit the system", got=counted(columns, "column"), expected=str(system.n))
    return system.B, output


def mean_of_parts(f: Callable[[Array], Array], edges: Array) -> tuple[float, float]:
    """The mean of f over the period, panels halved until it stands still, and its last change."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    last, change = np.inf, np.inf
    while True:
        h = np.diff(edges)[:, None]
        mean = float(f((edges[:-1, None] + h * (x + 1) / 2).ravel()) @ (h * w / 2).ravel()) / float(edges[-1])
        change, before, last = abs(mean - last), change, mean
        if change > before or change <= EPS * abs(last) or len(h) > MOST_PANELS:
            return mean, change + NODES * EPS * abs(last)
        edges = divide_segments(edges, 2)
