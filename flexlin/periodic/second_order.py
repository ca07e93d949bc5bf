"""The second-order equations behind a periodic system."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import MatrixFunction, OneOfThree, SecondOrderFunction, SecondOrderLoop


@dataclass(frozen=True)
class SecondOrder:
    """M(t) y'' + D(t) y' + K(t) y = force(t) u: each a function (N,) -> (N, n, n) or (N, n, m)."""

    M: MatrixFunction
    D: MatrixFunction
    K: MatrixFunction
    force: MatrixFunction | None = None
    together: SecondOrderFunction | None = None

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """M, D, K at the times t, in one call where the maker gave `together`."""
        return (self.M(t), self.D(t), self.K(t)) if self.together is None else self.together(t)

    def stacked(self, t: Array) -> Array:
        """[M D K] at the times t, (N, n, 3 n)."""
        return np.concatenate(self.sample(t), axis=2)

    def feedback(self, gain: MatrixFunction) -> "SecondOrder":
        """The equations with u = -gain(t) [y; y']."""
        if self.force is None:
            raise ArgumentError("the equations have no input", got="force = None", expected="an input matrix")
        together = SecondOrderLoop(self.sample, self.force, gain)
        return SecondOrder(self.M, OneOfThree(together, 1), OneOfThree(together, 2), self.force, together)
