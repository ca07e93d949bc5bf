"""The periodic Kalman filter by duality, and the loop that it closes with a state feedback."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, at_times
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable
from flexlin.linearization.law import Law
from flexlin.periodic.coefficients import Combined
from flexlin.periodic.riccati.linear_quadratic import RiccatiSolution
from flexlin.periodic.riccati.riccati import periodic_riccati
from flexlin.periodic.system import (
    Backward,
    MatrixFunction,
    PeriodicSystem,
    as_matrix_function,
    as_port,
    check_samples,
    dual_system,
    with_matrices,
)
from flexlin.summary import immutable


@immutable(eq=False)
class Estimator:
    """A periodic state estimator.

        x_e' = A x_e + B u + L(t) (measurement - C x_e),   L = P C' V^-1

    Attributes
    ----------
    system : PeriodicSystem
        The plant, with n states.
    C : function of times (N,) -> (N, p, n)
        What is measured.
    dual : RiccatiSolution
        Solution of the dual problem, with time reversed.
    closed_loop : PeriodicSystem
        The system A - L C of the estimate's error, for Floquet's verdict.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0)
    >>> estimator = fl.control.kalman_filter(system, [[1.0, 0.0]], np.eye(2), np.eye(1))
    >>> estimator.L(0.0).round(4)
    array([[1.7321],
           [1.    ]])
    >>> fl.floquet(estimator.closed_loop).verdict
    'stable'
    """

    system: PeriodicSystem
    C: MatrixFunction
    dual: RiccatiSolution
    closed_loop: PeriodicSystem

    @property
    def error(self) -> float:
        """The relative error of P."""
        return self.dual.error

    @property
    def status(self) -> str:
        """What the error means."""
        return self.dual.status

    def P(self, t: ArrayLike) -> Array:
        """Return the covariance of the estimate's error x - x_e.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            P(t), in the squared units of the states.
        """
        return at_times(lambda t: self.dual.X(-t), t)

    def L(self, t: ArrayLike) -> Array:
        """Return the gain of the filter.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, p) or (n, p)
            L(t).
        """
        return at_times(lambda t: np.swapaxes(self.dual.K(-t), 1, 2), t)


@checked
def kalman_filter(
    system: PeriodicSystem,
    C: MatrixFunction | ArrayLike,
    W: MatrixFunction | ArrayLike,
    V: MatrixFunction | ArrayLike,
    tol: float = 1e-9,
) -> Estimator:
    """Design the periodic Kalman filter of a measurement C x + v.

        P' = A P + P A' - P C' V^-1 C P + W,   P(t + T) = P(t),   L = P C' V^-1

    It is the optimal feedback of the dual system, with time reversed:  A -> A(-t)',  B -> C(-t)',  Q -> W(-t),  R -> V(-t).
    Assumes white noise of intensities W on x' and V on the measurement, (C, A) detectable, (A, W) stabilisable.

    Parameters
    ----------
    system : PeriodicSystem
        The plant, with n states.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        What is measured.
    W : array_like (n, n), or function of times (N,) -> (N, n, n)
        Intensity of the noise on x'.
    V : array_like (p, p), or function of times (N,) -> (N, p, p)
        Intensity of the noise of the measurement.
    tol : float
        Wanted relative error of P.

    Returns
    -------
    Estimator
        Covariance P(t), gain L(t), their error, and the loop A - L C.

    Raises
    ------
    ArgumentError
        When C or an intensity does not fit.
    NotDetectable
        When a mode that does not decay is not measured.
    NotStabilizable
        When W does not excite such a mode.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), ch. 7.

    Examples
    --------
    A constant scalar system x' = x + w: P solves 2 P - P^2 + 1 = 0.

    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[1.0]], 1.0)
    >>> estimator = fl.control.kalman_filter(system, [[1.0]], [[1.0]], [[1.0]])
    >>> print(f"{estimator.P(0.0).item():.6f} {1 + np.sqrt(2):.6f}")
    2.414214 2.414214
    """
    C = as_port("C", C, (None, system.n), system.period)
    W, V = (as_matrix_function(name, value) for name, value in (("W", W), ("V", V)))
    for name, noise in (("W", W), ("V", V)):
        check_samples(name, noise, system.period)
    T = system.period
    with said_of_a_filter():
        solution = periodic_riccati(dual_system(system, C), Backward(W, T), Backward(V, T), tol=tol)
    open_loop = with_matrices(system, system.A, Backward(solution.K, T), others=(W, V))
    return Estimator(system, C, solution, open_loop.feedback(C))


@contextmanager
def said_of_a_filter() -> Iterator[None]:
    """Say of the filter what is refused of its dual problem, whose input is the measurement and whose weight is the noise."""
    try:
        yield
    except NotStabilizable as reason:
        raise NotDetectable(
            reason.what.replace("cannot be", "is not").replace("reached by the input", "seen by the measurement"),
            got=reason.got,
            todo="add a sensor that sees it",
        ) from None
    except NotDetectable as reason:
        raise NotStabilizable(
            reason.what.replace("seen by the weight Q", "excited by the noise W"),
            got=reason.got,
            todo="give the mode's states noise in W",
        ) from None


def close_estimated(A: Array, B: Array, K: Array, L: Array, C: Array, rates: Array) -> Array:
    """[[A, -B K, -B K_z], [L C, A - B K - L C, -B K_z], [R, 0, F]] at some times; rates (k, n + k) = [R, F], k may be 0."""
    n, k, BK, LC = A.shape[1], len(rates), B @ K, L @ C
    out = np.zeros((len(A), 2 * n + k, 2 * n + k))
    out[:, :n, :n], out[:, :n, n:] = A, -BK
    out[:, n : 2 * n, :n], out[:, n : 2 * n, n:] = LC, -BK
    out[:, n : 2 * n, n : 2 * n] += A - LC
    out[:, 2 * n :, :n], out[:, 2 * n :, 2 * n :] = rates[:, :n], rates[:, n:]
    return out


@checked
def output_feedback(made: Design | Law, estimator: Estimator) -> PeriodicSystem:
    """Close the loop of a design, or of a law's feedback, through an estimator.

        [x; x_e]' = [[A, -B K], [L C, A - B K - L C]] [x; x_e],   u = -K x_e

    Integrals of a design stay integrals of what is measured, z' = rates [x; z] and u = -K [x_e; z].

    Parameters
    ----------
    made : Design or Law
        Where the gain K comes from.
    estimator : Estimator
        Of the same plant.

    Returns
    -------
    PeriodicSystem
        The system of 2n + k states. Its exponents are those of A - B K and of A - L C together (separation).

    Raises
    ------
    ArgumentError
        When design and estimator belong to systems of different size, or the plant has no input.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.control.pd_feedback(system, [0], [2.0], [3.0])
    >>> estimator = fl.control.kalman_filter(system, [[1.0, 0.0]], np.eye(2), np.eye(1))
    >>> loop = fl.control.output_feedback(made, estimator)
    >>> np.sort(fl.floquet(loop).exponents.real).round(4)
    array([-2.   , -1.   , -0.866, -0.866])
    """
    system = estimator.system
    gain, breaks = (made.gain, ()) if isinstance(made, Law) else (made.K, made.closed_loop.breaks)
    rates = np.zeros((0, system.n)) if made.controller is None else made.controller.rates
    states = gain(np.zeros(1)).shape[2] - len(rates)
    if states != system.n or system.B is None:
        raise ArgumentError(
            "the design and the estimator do not fit", got=(states, system.n), expected="one plant with input"
        )
    loop = Combined(partial(close_estimated, rates=rates), (system.A, system.B, gain, estimator.L, estimator.C))
    return with_matrices(estimator.closed_loop, loop, breaks=breaks, others=(gain,))
