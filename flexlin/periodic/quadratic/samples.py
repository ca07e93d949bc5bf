"""The coefficients of a linear-quadratic problem at times, in units of the states, and what a solution misses there."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.lyapunov import step_exactly, twice
from flexlin.periodic.quadratic.nodes import Nodes
from flexlin.periodic.quadratic.scattering import transpose
from flexlin.periodic.resolved.companion import ResolvedCompanion, couple_uncertainty
from flexlin.periodic.resolved.matrix import ResolvedMatrix


@dataclass(frozen=True)
class Samples:
    """Ar, G with G G' = B R^-1 B', and Qr of a problem at times, in units of the states."""

    A: Array
    G: Array
    Q: Array
    units: Array

    @classmethod
    def of(cls, problem: LinearQuadratic, t: Array, units: Array) -> "Samples":
        A, G, Q = problem.factored(t)
        return cls(A * (units[:, None] / units), G * units[:, None], Q / np.outer(units, units), units)

    def compare(self, X: Array, slopes: Array) -> tuple[Array, Array]:
        """The residual F = X' + A' X + X A - X G G' X + Q, and the loop A - G G' X."""
        pull = transpose(self.G) @ X
        F = slopes + twice(X @ self.A)
        F -= transpose(pull) @ pull
        F += self.Q
        return F, self.A - self.G @ pull

    def step(self, problem: LinearQuadratic, nodes: Nodes) -> Array | None:
        """The loop's half steps where they are known exactly: without an input it is A."""
        return None if self.G.any() else step_exactly(problem.A, nodes, self.units)

    def doubt(self, problem: LinearQuadratic, t: Array, X: Array) -> Array:
        """What A and Q, as they were represented and rounded, leave unknown of the residual of a loop without an input."""
        missed, both = np.zeros_like(X), np.outer(self.units, self.units)
        if self.G.any():
            return missed
        if isinstance(problem.A, ResolvedMatrix | ResolvedCompanion):
            eye = np.broadcast_to(np.eye(X.shape[2]), X.shape)
            missed += twice(couple_uncertainty(problem.A, t, X * both, eye, in_mean=True) / both)
        if isinstance(problem.Q, ResolvedMatrix):
            missed += problem.Q.error_near(t) / both
        return missed

    def sum_sizes(self, X: Array, slopes: Array) -> Array:
        """The sizes of all that is added in the residual; what is lost in G' X is multiplied by G' X."""
        pull = transpose(self.G) @ X
        by_pull = transpose(np.abs(pull)) @ (transpose(np.abs(self.G)) @ np.abs(X))
        return np.abs(slopes) + twice(np.abs(X) @ np.abs(self.A) + by_pull) + np.abs(self.Q)


def measure_states(X: Array) -> Array:
    """The root of the sizes of the largest diagonal entries of X (N, n, n), as powers of two: (n,)."""
    diagonal = np.sqrt(np.abs(np.diagonal(X, axis1=1, axis2=2)).max(axis=0))
    least = 1e-12 * diagonal.max() or 1.0
    return np.asarray(2.0 ** np.round(np.log2(np.maximum(diagonal, least))))
