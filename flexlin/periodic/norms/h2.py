"""The H2 norm of a periodic system, by its periodic Lyapunov equation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import MatrixFunction, as_matrix_function, check_samples
from flexlin.periodic.grid import divide_segments
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.resolved.panels import MOST_PANELS, NODES
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import represent

EPS = float(np.finfo(float).eps)


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
    NotStabilizable
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

    def weight(t: Array) -> Array:
        values = output(t)
        return np.swapaxes(values, 1, 2) @ values

    solution = periodic_lyapunov(system, weight, positive("tol", tol))

    def power(t: Array) -> Array:
        reached = B(t)
        product = np.einsum("tki,tkl,tli->t", reached, solution.X(t), reached)
        return np.stack(
            [product, (np.abs(reached).sum(axis=1) ** 2).sum(axis=1), np.abs(solution.X(t)).max(axis=(1, 2))]
        )

    (square, size, largest), quadrature = mean_of_parts(power, np.union1d(solution.edges, B.edges))
    value = float(np.sqrt(max(square, 0.0)))
    doubt = solution.error * largest * size + quadrature
    return H2Norm(value, float(doubt / (2 * value) if value**2 > doubt else np.sqrt(abs(square) + doubt)))


def check_ports(system: PeriodicSystem, C: MatrixFunction | ArrayLike) -> tuple[MatrixFunction, MatrixFunction]:
    """Return B and C as functions of time. Raises: ArgumentError where there is no input or C does not fit."""
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
    output = as_matrix_function("C", C)
    columns = check_samples("C", output, system.period).shape[2]
    if columns != system.n:
        raise ArgumentError("C does not fit the system", got=f"{columns} columns", expected=str(system.n))
    return system.B, output


def mean_of_parts(f: Callable[[Array], Array], edges: Array) -> tuple[Array, float]:
    """The mean of f (rows, N) over the period, panels halved until the first row stands still, and its last change."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    last, change = np.inf, np.inf
    while True:
        h = np.diff(edges)[:, None]
        values = f((edges[:-1, None] + h * (x + 1) / 2).ravel())
        mean = values @ (h * w / 2).ravel() / edges[-1]
        change, before, last = abs(mean[0] - last), change, mean[0]
        if change > before or change <= EPS * abs(last) or len(h) > MOST_PANELS:
            return np.array([mean[0], mean[1], values[2].max()]), float(change + NODES * EPS * abs(last))
        edges = divide_segments(edges, 2)
