"""The periodic Kalman filter by duality, and the loop that it closes with a state feedback."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, times
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable
from flexlin.periodic.quadratic.riccati import RiccatiSolution, periodic_riccati
from flexlin.periodic.system import MatrixFunction, PeriodicSystem, as_matrix_function, check_samples


@dataclass(frozen=True, eq=False)
class Estimator:
    """The estimator x_e' = A x_e + B u + L(t) (measurement - C x_e), with L = P C' V^-1.

    `P(t)` (N, n, n) is the covariance of x - x_e, `L(t)` (N, n, p) the gain; `closed_loop` is the system of the error,
    A - L C, for Floquet; `error`, `status` as of the Riccati solution of the dual problem.
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
        """The covariance of the estimate's error at times (N,)."""
        return self.dual.X(-times(t))

    def L(self, t: ArrayLike) -> Array:
        """The filter gain at times (N,)."""
        return np.swapaxes(self.dual.K(-times(t)), 1, 2)


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
    Assumes white noise of intensities W (n, n) on x' and V (p, p) on the measurement, (C, A) detectable, (A, W) stabilisable.

    Parameters: C (p, n), W, V: constants or functions (N,) -> (N, ., .).
    Returns: an `Estimator`.
    Raises: ArgumentError; NotDetectable when a mode that does not decay is not measured; NotStabilizable when W does not excite it.
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 7.
    """
    C, W, V = (as_matrix_function(name, value) for name, value in (("C", C), ("W", W), ("V", V)))
    if check_samples("C", C, system.period).shape[2] != system.n:
        raise ArgumentError("C does not fit the system", expected=f"(p, {system.n})")
    T = system.period
    breaks = tuple((T - b) % T for b in system.breaks)
    dual = PeriodicSystem(backward(system.A, T), T, backward(C, T), breaks)
    try:
        solution = periodic_riccati(dual, backward(W, T), backward(V, T), tol=tol)
    except NotStabilizable as reason:
        raise NotDetectable(
            "a mode that does not decay is not seen by the measurement",
            got=reason.got,
            todo="add a sensor that sees it",
        ) from None
    except NotDetectable as reason:
        raise NotStabilizable(
            "a mode that does not decay is not excited by the noise W",
            got=reason.got,
            todo="give the mode's states noise in W",
        ) from None
    measured = PeriodicSystem(system.A, T, lambda t: np.swapaxes(solution.K(-t), 1, 2), system.breaks)
    return Estimator(system, C, solution, measured.feedback(C))


def backward(coefficient: MatrixFunction, period: float) -> MatrixFunction:
    """Return t -> coefficient(-t)', taken inside one period."""
    return lambda t: np.swapaxes(coefficient(np.mod(-t, period)), 1, 2)


def output_feedback(made: Design, estimator: Estimator) -> PeriodicSystem:
    """Close the loop of a state feedback through an estimator, u = -K x_e.

        [x; x_e]' = [[A, -B K], [L C, A - B K - L C]] [x; x_e]

    Returns: the system of 2n states, whose exponents are those of A - B K and of A - L C together (separation).
    Raises: ArgumentError when design and estimator belong to systems of different size.
    """
    system, C, K = estimator.system, estimator.C, made.K
    if made.closed_loop.n != system.n or system.B is None:
        raise ArgumentError(
            "the design and the estimator do not fit",
            got=(made.closed_loop.n, system.n),
            expected="one plant with input",
        )
    A, B = system.A, system.B

    def together(t: Array) -> Array:
        a, bk, lc = A(t), B(t) @ K(t), estimator.L(t) @ C(t)
        return np.concatenate([np.concatenate([a, -bk], axis=2), np.concatenate([lc, a - bk - lc], axis=2)], axis=1)

    return PeriodicSystem(together, system.period, None, (*system.breaks, *made.closed_loop.breaks))
