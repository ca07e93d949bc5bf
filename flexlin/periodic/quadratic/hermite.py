"""Dense output: a matrix function of time from its values and slopes at the five nodes of each panel."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from flexlin.checks import Array

NODES = 5
"""Nodes of a panel, equally spaced: four segments. With slopes, polynomials of degree 9."""


@dataclass(frozen=True)
class PanelPolynomials:
    """Polynomials of degree 9 in Chebyshev form, one for each panel [start_p, start_(p+1)]: coefficients (P, 10, rows, columns)."""

    starts: Array
    coefficients: Array

    def __call__(self, t: Array) -> Array:
        """Evaluate at times t (N,) between the first and the last node: (N, rows, columns)."""
        return self._sum(t, self.coefficients)

    def rate(self, t: Array) -> Array:
        """Evaluate the derivative by time."""
        slopes = chebyshev.chebder(self.coefficients, axis=1)
        width = np.diff(self.starts)[:, None, None, None]
        return self._sum(t, slopes * 2 / width)

    def tails(self) -> Array:
        """Return each panel's largest sum of the last two coefficients, (P,): what one degree less would have left out."""
        return np.abs(self.coefficients[:, -2:]).sum(axis=1).max(axis=(1, 2))

    def _sum(self, t: Array, coefficients: Array) -> Array:
        panel = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.starts) - 2)
        begin, end = self.starts[panel], self.starts[panel + 1]
        u = (2 * t - begin - end) / (end - begin)
        return np.einsum("tk,tkij->tij", chebyshev.chebvander(u, coefficients.shape[1] - 1), coefficients[panel])


def place_panel_nodes(starts: Array) -> Array:
    """Return the nodes of each panel, (P, 5), the last of one being the first of the next."""
    return starts[:-1, None] + np.diff(starts)[:, None] * np.linspace(0, 1, NODES)


def interpolate_panels(starts: Array, values: Array, slopes: Array) -> PanelPolynomials:
    """Fit the polynomials to values and slopes at the nodes, both (P, 5, rows, columns)."""
    u = np.linspace(-1, 1, NODES)
    degree = 2 * NODES - 1
    rows = chebyshev.chebvander(u, degree)
    derivative = chebyshev.chebder(np.eye(degree + 1), axis=0)
    slope_rows = chebyshev.chebvander(u, degree - 1) @ derivative
    inverse = np.linalg.inv(np.concatenate([rows, slope_rows]))
    half = 0.5 * np.diff(starts)[:, None, None, None]
    return PanelPolynomials(
        starts, np.einsum("ck,pkij->pcij", inverse, np.concatenate([values, slopes * half], axis=1))
    )
