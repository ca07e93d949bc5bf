"""X(t) of a linear-quadratic problem as a function, with the evidence that it is right."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.quadratic.hermite import PanelPolynomials
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic


@dataclass(frozen=True)
class RiccatiSolution:
    """X(t) and the gain K(t) of a linear-quadratic problem, at any time, with the evidence that they are right.

    `error` bounds |X error| / max |X| over the horizon and `gain_error` |K error| / max |K|: on panels from the difference
    between two accuracies of the segments (`method_error`), what the dense output leaves out, and rounding; of a Fourier
    series (on `segments` nodes) from its residual by a Lyapunov equation. `residual` is how far X(t) misses its differential
    equation between the nodes, relative to |X| per fastest time constant; `closure` is |X(T) - X(0)| / |X| (0 for a finite
    horizon); `symmetry` is the largest relative asymmetry of a segment's cost before it was symmetrised. Times are wrapped
    into the period when `periodic`.
    """

    problem: LinearQuadratic
    horizon: float
    periodic: bool
    series: PanelPolynomials | FourierSeries
    error: float
    gain_error: float
    method_error: float
    residual: float
    symmetry: float
    closure: float
    doublings: int
    segments: int
    status: str

    def X(self, t: ArrayLike) -> Array:
        """Return the cost matrix at times t (N,), (N, n, n), or at one time, (n, n)."""
        return at_times(lambda s: self.series(self._inside(s)), t)

    def K(self, t: ArrayLike) -> Array:
        """Return the gain K = R^-1 (B' X + N') at times t (N,), (N, m, n), or at one time, (m, n)."""
        return at_times(self._gain, t)

    def _gain(self, t: Array) -> Array:
        inside = self._inside(t)
        return self.problem.gain(inside, self.series(inside))

    def _inside(self, t: Array) -> Array:
        return np.mod(t, self.horizon) if self.periodic else np.clip(t, 0.0, self.horizon)
