"""A matrix function of time, or M, D, K and the state matrix that they make, as one series or as panels of polynomials."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array
from flexlin.periodic.coefficients import build_companion
from flexlin.periodic.interpolation import NODES, ChebyshevPanels, FourierSeries, divided
from flexlin.precision import EPS, SAFETY
from flexlin.summary import represent

Series = FourierSeries | ChebyshevPanels
"""The one function of time: called with times, it has a period, edges, a degree, a mean and a derivative."""
GAUSS = np.polynomial.legendre.leggauss(NODES)
"""Nodes in (-1, 1) and weights of the quadrature on a panel."""


@dataclass(frozen=True)
class Discontinuity:
    """A place that was found, not named: time in [0, T) in s, kind "jump" or "kink" (a jump of a derivative)."""

    time: float
    kind: str


@dataclass(frozen=True, eq=False, repr=False)
class Resolved:
    """A matrix function of period T as one Fourier series, or as one Chebyshev series for each of its panels.

    series: the coefficients; breaks: named and found places in [0, T) where it is not smooth; found: those that were not named;
    error (rows, columns): bound on |series(t) - A(t)| over the period, in the units of the entry, measured at the check points;
    samples: how often A was evaluated; local (P, rows, columns): bound in the mean over each panel, where it is known;
    beside (B, rows, columns): bound on its integral close to each of the breaks, in the units of the entry times s.
    """

    series: Series
    breaks: tuple[float, ...]
    found: tuple[Discontinuity, ...]
    error: Array
    samples: int
    local: Array | None = None
    beside: Array | None = None

    @property
    def period(self) -> float:
        """T in s."""
        return self.series.period

    @property
    def edges(self) -> Array:
        """Edges of the panels from 0 to T, (P + 1,); a Fourier series has one panel."""
        return self.series.edges

    @property
    def panels(self) -> int:
        """The number of panels."""
        return len(self.edges) - 1

    @property
    def degree(self) -> int:
        """The highest harmonic of a Fourier series, or the degree of the panels' polynomials."""
        return self.series.degree

    @property
    def constant(self) -> bool:
        """Whether nothing depends on t: then `mean()` is the matrix."""
        return self.series.constant

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of what is represented."""
        return self.error.shape[0], self.error.shape[1]

    def error_near(self, t: Array) -> Array:
        """SAFETY times the bound in the mean over the panel that holds each of the times (N,): (N, rows, columns)."""
        panel = np.clip(np.searchsorted(self.edges, np.mod(t, self.period), side="right") - 1, 0, self.panels - 1)
        return np.asarray(SAFETY * self.mean_error(self.edges)[panel])

    def mean_error(self, marks: Array) -> Array:
        """The bound in the mean over each interval between increasing marks (K + 1,): (K, rows, columns); the error is SAFETY times it."""
        if self.local is None:
            return np.broadcast_to(self.error / SAFETY, (len(marks) - 1, *self.shape))
        whole = np.cumsum(self.local * np.diff(self.edges)[:, None, None], axis=0)
        panel = np.clip(np.searchsorted(self.edges, marks, side="right") - 1, 0, self.panels - 1)
        before = np.concatenate([np.zeros((1, *self.shape)), whole])[panel]
        total = before + self.local[panel] * (marks - self.edges[panel])[:, None, None]
        whole = np.maximum(np.diff(total, axis=0), np.diff(marks)[:, None, None] * self.local.min(axis=0))
        if self.beside is not None:
            holder = np.clip(np.searchsorted(marks, self.breaks, side="right") - 1, 0, len(marks) - 2)
            np.add.at(whole, holder, self.beside)
        return np.asarray(whole / np.diff(marks)[:, None, None])


class ResolvedMatrix(Resolved):
    """A matrix function A(t) = A(t + T) by its series."""

    __repr__ = represent

    def __call__(self, t: ArrayLike, left: bool = False) -> Array:
        """Evaluate at times t (N,), any real: (N, rows, columns), or at one time: (rows, columns).

        At an edge the panel behind it counts; with `left` the one before it.
        """
        return self.series(t, left=left) if isinstance(self.series, ChebyshevPanels) else self.series(t)

    def mean(self) -> Array:
        """The integral of A over the period, divided by T (rows, columns)."""
        return self.series.mean()

    def derivative(self) -> "ResolvedMatrix":
        """A'(t) inside the panels; its error: that of A times the rate of the fastest wave or polynomial (Markov's inequality)."""
        return ResolvedMatrix(
            self.series.derivative(), self.breaks, self.found, self.error * self.series.rate, self.samples
        )


class ResolvedCompanion(Resolved):
    """A(t) = [[0, I], [-M^-1 K, -M^-1 D]] from the series of [M D K] (n, 3 n), of which all bounds speak.

    M is solved for where A is asked for, so the series hold the well-conditioned numbers and not what M^-1 makes of their rounding.
    """

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """M, D, K at times t (N,), each (N, n, n)."""
        return self.split(self.series(t))

    def split(self, values: Array) -> tuple[Array, Array, Array]:
        """M, D, K out of [M D K] (..., n, 3 n)."""
        n = values.shape[-2]
        return values[..., :n], values[..., n : 2 * n], values[..., 2 * n :]

    def __call__(self, t: Array) -> Array:
        """A at times t (N,): (N, 2 n, 2 n). Raises: SingularMassMatrix, naming the time."""
        return build_companion(self.sample(t), t)

    def mean(self) -> Array:
        """The integral of A over the period, divided by T, by quadrature."""
        x, w = GAUSS
        edges = divided(self.edges, self.period * NODES / (8 * max(NODES, self.degree)))
        h = np.diff(edges)[:, None]
        t = (edges[:-1, None] + h * (x + 1) / 2).ravel()
        return np.einsum("t,tij->ij", (h * w / (2 * self.period)).ravel(), self(t))


def weigh_entries(blocks: Array) -> Array:
    """Sizes (n, 3 n) below which the entries of [M D K], sampled as (N, n, 3 n), need not be known to many digits.

        M_ij ~ sqrt(M_ii M_jj),   K_ij ~ sqrt(K_ii K_jj),   D_ij ~ sqrt(M_ij K_ij)

    A change of 1e-16 of these is what rounding of the diagonals makes (in coordinates scaled to the same inertia). What two expressions
    cancel to, where an entry ought to be zero, is noise; its digits are not followed. An entry counts for more where the one across the
    diagonal is large, since exponents depend on their product.
    """
    n = blocks.shape[1]
    size = np.abs(blocks).max(axis=0).reshape(n, 3, n)
    inertia, stiffness = np.sqrt(size[:, 0].diagonal()), np.sqrt(size[:, 2].diagonal())
    root = np.array([inertia, np.sqrt(inertia * stiffness), stiffness])
    weight = root.T[:, :, None] * root
    across = np.maximum(size.transpose(2, 1, 0), weight)
    return (weight * (weight / np.where(across > 0, across, 1.0))).reshape(n, 3 * n)


def couple_uncertainty(
    resolved: ResolvedMatrix | ResolvedCompanion, t: Array, left: Array, right: Array, in_mean: bool = False
) -> Array:
    """Bounds on the entries of left dA right at times t (N,), (N, n, n) in 1/s, for left and right vectors (N, n, n).

        first order:   |L| |dA| |R|
        second order:  |V| (|dM| |z| + |dD| |R_v| + |dK| |R_y|),   V = L_v M^-1,   z = the accelerations that belong to R

    dA: roundings of the entries and the error of the series, anywhere, or in the mean over the panel where the sum over time counts.
    The second form keeps what M^-1 does to a rounding of M: the product with the left vectors is taken before the moduli.
    """
    error = resolved.error_near(t) if in_mean else resolved.error
    if not isinstance(resolved, ResolvedCompanion):
        known = SAFETY * EPS * np.abs(resolved(t)) + error
        return np.asarray(np.abs(left) @ (known @ np.abs(right)))
    M, D, K = resolved.sample(t)
    n = M.shape[-1]
    dM, dD, dK = (SAFETY * EPS * np.abs(X) + e for X, e in zip((M, D, K), resolved.split(error), strict=True))
    V = np.swapaxes(np.linalg.solve(np.swapaxes(M, -1, -2), np.swapaxes(left[..., n:], -1, -2)), -1, -2)
    position, rate = right[..., :n, :], right[..., n:, :]
    z = np.linalg.solve(M, K @ position + D @ rate)
    return np.asarray(np.abs(V) @ (dM @ np.abs(z) + dD @ np.abs(rate) + dK @ np.abs(position)))
