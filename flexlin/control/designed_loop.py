"""A controller design: what every kind of design hands back."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from flexlin.about.law import Law
from flexlin.checks import Array, at_times, real_array
from flexlin.errors import DesignError, NotStabilizable
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.riccati import RiccatiSolution, periodic_lyapunov
from flexlin.periodic.system import MatrixFunction, PeriodicSystem
from flexlin.summary import represent


@dataclass(frozen=True, eq=False)
class Repeated:
    """A function of one period or horizon, repeated."""

    gain: MatrixFunction
    period: float

    def __call__(self, t: Array) -> Array:
        return self.gain(np.mod(t, self.period))


@dataclass(frozen=True, eq=False)
class RunningCost:
    """The weight of the states in a closed loop, Q + K' R K - N K - K' N', as a function of time."""

    problem: LinearQuadratic
    K: MatrixFunction

    def __call__(self, t: Array) -> Array:
        K, problem = self.K(t), self.problem
        mixed = problem.N(t) @ K
        weight = problem.Q(t) + np.swapaxes(K, 1, 2) @ problem.R(t) @ K - mixed - np.swapaxes(mixed, 1, 2)
        return 0.5 * (weight + np.swapaxes(weight, 1, 2))


@dataclass(frozen=True, eq=False)
class Design:
    """A linear state feedback u = -K(t) x with its closed loop.

    `K(t)` takes times (N,) and gives (N, m, n); `error` is the relative error of K (what it means is said in `status`);
    `problem` holds the weights by which the loop is judged, whatever way its gain was found; `solution` is the Riccati
    solution when K is the optimal gain of `problem`.
    """

    name: str
    kind: str
    K: MatrixFunction
    closed_loop: PeriodicSystem
    error: float
    status: str
    problem: LinearQuadratic | None = None
    solution: RiccatiSolution | None = None

    __repr__ = represent

    @property
    def law(self) -> Law:
        """The design as a control law without feedforward; `law.with_gain(design.K)` gives another law this gain."""
        n, m = self.closed_loop.n, self.closed_loop.m
        return Law("none", Constant(np.zeros(m)), self.K, Constant(np.zeros(n)))

    @cached_property
    def value(self) -> RiccatiSolution:
        """The cost matrix of this loop: of the Riccati equation when K is optimal, else of the closed loop's Lyapunov equation.

        Raises: DesignError when the design has no weights; NotStabilizable when the loop is unstable.
        """
        if self.solution is not None:
            return self.solution
        problem = self.problem
        if problem is None:
            raise DesignError(
                f"the design {self.name!r} has no cost",
                got="no weights",
                expected="a problem with Q and R",
                todo="give `problem=linear_quadratic(system, Q, R)` when the design is made",
            )
        return periodic_lyapunov(self.closed_loop, RunningCost(problem, self.K))

    def X(self, t: ArrayLike) -> Array:
        """Return the cost matrix of the loop at times t (N,): (N, n, n)."""
        return at_times(self.value.X, t)

    def cost(self, x0: ArrayLike, t: float = 0.0) -> float:
        """Return the cost of starting at x0 at time t, x0' X(t) x0; infinite when the loop is unstable.

        The cost is the integral of x' Q x + 2 x' N u + u' R u from t on.
        """
        start = real_array("x0", x0, (self.closed_loop.n,))
        try:
            X = self.X(np.array([t]))[0]
        except NotStabilizable:
            return float("inf")
        return float(start @ X @ start)
