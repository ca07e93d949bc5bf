"""A periodic response as a function of time, with its error: how it is read, drawn and tabulated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times, whole
from flexlin.errors import ArgumentError
from flexlin.plots.view import Series, Shown, View
from flexlin.summary import represent

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class PiecewiseSolution:
    """The collocation polynomials: x(t_k + theta h_k) = start_k + h_k sum_m slope_km int_0^theta P_m."""

    edges: Array
    start: Array
    slope: Array

    __repr__ = represent

    def __call__(self, t: Array) -> Array:
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.start) - 1)
        h = np.diff(self.edges)[k]
        integral = h[:, None] * integrate_legendre((t - self.edges[k]) / h, self.slope.shape[1])
        return self.start[k] + (integral[:, None, :] @ self.slope[k])[:, 0]


@dataclass(frozen=True)
class ForcedResponse(Shown):
    """The periodic solution x(t) of a periodic system under a periodic force.

    Call it with times (N,) to get (N, n), or with one time to get (n,).

    Attributes
    ----------
    solution : PiecewiseSolution
        The collocation polynomials.
    period : float
        Period in s.
    error : float
        Estimated bound of the error at any time, in the unit of x.
    amplification : float
        How much an error of the force or of rounding may grow: 1 / the smallest singular value of the periodicity condition.
    segments : int
        Segments of the period.
    status : str
        What to make of it.

    Examples
    --------
    >>> import flexlin as fl
    >>> response = fl.forced_response(fl.PeriodicSystem([[-2.0]], 1.0), [4.0])
    >>> response([0.0, 7.3]).round(10).tolist(), response.error < 1e-9
    ([[2.0], [2.0]], True)
    """

    solution: PiecewiseSolution
    period: float
    error: float
    amplification: float
    segments: int
    status: str

    __repr__ = represent

    def __call__(self, t: ArrayLike) -> Array:
        """The state at times (N,), any real numbers, (N, n), or at one time, (n,)."""
        return at_times(lambda s: self.solution(np.mod(s, self.period)), t)

    def to_xarray(self, points: int = 257, names: Sequence[str] = (), units: Sequence[str] = ()) -> "xarray.Dataset":
        """Return the states over a period as a dataset.

        Parameters
        ----------
        points : int
            Times of the period, both ends included.
        names : sequence of str, optional
            Names of the n states; x1, x2 ... by default.
        units : sequence of str, optional
            Their units.

        Returns
        -------
        xarray.Dataset
            `response` by time and state; error, status and period as attributes.

        Raises
        ------
        ArgumentError
            When there are not as many names or units as states.
        """
        import xarray

        t = np.linspace(0.0, self.period, whole("points", points, 2))
        states = self(t)
        labels = label_states(states.shape[1], names, units)
        attributes = {"error": self.error, "status": self.status, "period": self.period}
        series = {"response": (("time", "state"), states)}
        coords = {"time": ("time", t, {"units": "s"}), "state": labels[0], "unit": ("state", labels[1])}
        return xarray.Dataset(series, coords=coords, attrs=attributes)

    def _view(self) -> View:
        t = np.linspace(0.0, self.period, 257)
        states = self(t)
        series = tuple(Series(f"x{i + 1}", t, x) for i, x in enumerate(states.T))
        facts = (
            f"period {self.period:.6g} s, error {self.error:.0e}, amplification {self.amplification:.3g}",
            self.status,
        )
        return View("periodic response", "", facts, "time in s", "states, each in its own unit", series)


def label_states(count: int, names: Sequence[str], units: Sequence[str]) -> tuple[list[str], list[str]]:
    """Names and units of states, of which there must be `count` where any are given."""
    for what, given in (("names", names), ("units", units)):
        if len(given) not in (0, count):
            raise ArgumentError(f"{what} do not fit the states", got=len(given), expected=str(count))
    return list(names) or [f"x{i + 1}" for i in range(count)], list(units) or [""] * count


def integrate_legendre(theta: Array, count: int) -> Array:
    """int_0^theta P_m(2 s - 1) ds for m < count: (N, count)."""
    P = legvander(2 * theta - 1, count)
    m = np.arange(1, count)
    return np.column_stack([theta, (P[:, 2:] - P[:, :-2]) / (2 * (2 * m + 1))])
