"""X(t) of a linear-quadratic problem as a function, with the evidence that it is right."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times
from flexlin.periodic.chebyshev import ChebyshevPanels
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.grid import divided
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.summary import represent

WAVES = 3.0
"""Harmonics of a Fourier series for each panel of degree NODES - 1 that replaces it."""


@dataclass(frozen=True)
class RiccatiSolution:
    """X(t) and the gain K(t) of a linear-quadratic problem, at any time, with the evidence that they are right.

    Times are wrapped into the period when `periodic`, and held inside [0, horizon] otherwise.

    Attributes
    ----------
    problem : LinearQuadratic
        The coefficients and weights.
    horizon : float
        Period or length of the horizon, in s.
    periodic : bool
        Whether X repeats.
    series : ChebyshevPanels or FourierSeries
        X between its nodes.
    error : float
        Bounds |X error| / max |X| over the horizon: what its residual amounts to, by the closed loop's Lyapunov equation.
    gain_error : float
        Bounds |K error| / max |K| likewise.
    method_error : float
        The part of `error` that is not rounding.
    residual : float
        How far X(t) misses its differential equation between the nodes, relative to |X| per fastest time constant.
    doublings : int
        How often the period was doubled.
    segments : int
        Nodes.
    status : str
        What to make of it.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.periodic.quadratic.riccati import periodic_riccati
    >>> solution = periodic_riccati(fl.PeriodicSystem([[1.0]], 1.0, B=[[1.0]]), [[1.0]], [[1.0]])
    >>> print(f"{solution.X(0.5).item():.8f} {solution.K([0.5, 0.7]).shape} {solution.status}")
    2.41421356 (2, 1, 1) converged
    """

    problem: LinearQuadratic
    horizon: float
    periodic: bool
    series: ChebyshevPanels | FourierSeries
    error: float
    gain_error: float
    method_error: float
    residual: float
    doublings: int
    segments: int
    status: str

    __repr__ = represent

    @property
    def edges(self) -> Array:
        """Times from 0 to the horizon between which polynomials follow X and the coefficients."""
        if isinstance(self.series, ChebyshevPanels):
            return self.series.edges
        return divided(self.series.edges, self.horizon * WAVES / max(self.series.degree, 1))

    def X(self, t: ArrayLike) -> Array:
        """Return the cost matrix.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            X(t), symmetric.
        """
        return at_times(lambda s: self.series(self._inside(s)), t)

    def K(self, t: ArrayLike) -> Array:
        """Return the gain K = R^-1 (B' X + N').

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, m, n) or (m, n)
            K(t).
        """
        return at_times(self._gain, t)

    def _gain(self, t: Array) -> Array:
        inside = self._inside(t)
        return self.problem.gain(inside, self.series(inside))

    def _inside(self, t: Array) -> Array:
        return np.mod(t, self.horizon) if self.periodic else np.clip(t, 0.0, np.nextafter(self.horizon, 0.0))
