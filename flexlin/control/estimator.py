"""The periodic Kalman filter by duality, and the loop that it closes with a state feedback."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.about.law import Law
from flexlin.checks import Array, at_times
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable
from flexlin.periodic.quadratic.riccati import RiccatiSolution, periodic_riccati
from flexlin.periodic.system import MatrixFunction, PeriodicSystem, as_matrix_function, check_samples
from flexlin.summary import represent


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

    __repr__ = represent

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
        return at_times(lambda t: self.dual.X(-t), t)

    def L(self, t: ArrayLike) -> Array:
        """The filter gain at times (N,)."""
        return at_times(lambda t: np.swapaxes(self.dual.K(-t), 1, 2), t)


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
    dual = PeriodicSystem(Backward(system.A, T), T, Backward(C, T), breaks)
    try:
        solution = periodic_riccati(dual, Backward(W, T), Backward(V, T), tol=tol)
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
    measured = PeriodicSystem(system.A, T, FilterGain(solution), system.breaks)
    return Estimator(system, C, solution, measured.feedback(C))


@dataclass(frozen=True, eq=False)
class Backward:
    """t -> coefficient(-t)', taken inside one period."""

    coefficient: MatrixFunction
    period: float

    def __call__(self, t: Array) -> Array:
        return np.swapaxes(self.coefficient(np.mod(-t, self.period)), 1, 2)


@dataclass(frozen=True, eq=False)
class FilterGain:
    """L(t) = K(-t)' of the dual problem."""

    dual: RiccatiSolution

    def __call__(self, t: Array) -> Array:
        return np.swapaxes(self.dual.K(-t), 1, 2)


@dataclass(frozen=True, eq=False)
class EstimatedLoop:
    """[[A, -B K], [L C, A - B K - L C]] as a function of time."""

    estimator: Estimator
    gain: MatrixFunction

    def __call__(self, t: Array) -> Array:
        system = self.estimator.system
        assert system.B is not None
        A, BK, LC = system.A(t), system.B(t) @ self.gain(t), self.estimator.L(t) @ self.estimator.C(t)
        return np.concatenate([np.concatenate([A, -BK], axis=2), np.concatenate([LC, A - BK - LC], axis=2)], axis=1)


def output_feedback(made: Design | Law, estimator: Estimator) -> PeriodicSystem:
    """Close the loop of a design, or of a law's feedback, through an estimator, u = -K x_e.

        [x; x_e]' = [[A, -B K], [L C, A - B K - L C]] [x; x_e]

    Returns: the system of 2n states, whose exponents are those of A - B K and of A - L C together (separation).
    Raises: ArgumentError when design and estimator belong to systems of different size.
    """
    system = estimator.system
    gain, breaks = (made.gain, ()) if isinstance(made, Law) else (made.K, made.closed_loop.breaks)
    states = gain(np.zeros(1)).shape[2]
    if states != system.n or system.B is None:
        raise ArgumentError(
            "the design and the estimator do not fit", got=(states, system.n), expected="one plant with input"
        )
    return PeriodicSystem(EstimatedLoop(estimator, gain), system.period, None, (*system.breaks, *breaks))
