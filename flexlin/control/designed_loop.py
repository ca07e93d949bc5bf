"""A controller design: what every kind of design hands back."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import NotStabilizable
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.riccati import RiccatiSolution, periodic_lyapunov
from flexlin.periodic.system import MatrixFunction, PeriodicSystem


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

    @cached_property
    def value(self) -> RiccatiSolution:
        """The cost matrix of this loop: of the Riccati equation when K is optimal, else of the closed loop's Lyapunov equation.

        Raises: ValueError when the design has no weights; NotStabilizable when the loop is unstable.
        """
        if self.solution is not None:
            return self.solution
        problem = self.problem
        if problem is None:
            raise ValueError(f"the design {self.name!r} has no weights, so it has no cost")

        def running(t: Array) -> Array:
            K, N = self.K(t), problem.N(t)
            mixed = N @ K
            weight = problem.Q(t) + np.swapaxes(K, 1, 2) @ problem.R(t) @ K - mixed - np.swapaxes(mixed, 1, 2)
            return 0.5 * (weight + np.swapaxes(weight, 1, 2))

        return periodic_lyapunov(self.closed_loop, running)

    def X(self, t: ArrayLike) -> Array:
        """Return the cost matrix of the loop at times t (N,): (N, n, n)."""
        return self.value.X(t)

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
