"""Second-order coefficients M, D, K over one period, resolved each, and the state matrix that they make."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.resolved.matrix import Discontinuity, OfSeries, ResolvedMatrix, Series
from flexlin.periodic.resolved.panels import NODES
from flexlin.periodic.second_order import build_companion

HIDDEN = 1e-3
"""An entry is resolved to 1e-13 of this share of its weight, or of its own size where that is larger: no worse than rounding."""


@dataclass(frozen=True, eq=False)
class ResolvedCompanion(OfSeries):
    """A(t) = [[0, I], [-M^-1 K, -M^-1 D]] from the series of [M D K].

    M is solved for where A is asked for, so the series hold the well-conditioned numbers and not what M^-1 makes of their rounding.
    """

    blocks: ResolvedMatrix

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """M, D, K at times t (N,), each (N, n, n)."""
        return self.split(self.blocks(t))

    def split(self, values: Array) -> tuple[Array, Array, Array]:
        """M, D, K out of [M D K] (..., n, 3 n)."""
        n = values.shape[-2]
        return values[..., :n], values[..., n : 2 * n], values[..., 2 * n :]

    def __call__(self, t: Array) -> Array:
        """A at times t (N,): (N, 2 n, 2 n). Raises: SingularMassMatrix, naming the time."""
        return build_companion(*self.sample(t), t)

    def mean_error(self, marks: Array) -> Array:
        """The bound on [M D K] (K, n, 3 n) in the mean over each interval between increasing marks (K + 1,)."""
        return self.blocks.mean_error(marks)

    def mean(self) -> Array:
        """The integral of A over the period, divided by T, by quadrature."""
        edges, T = self.edges, self.period
        if isinstance(self.series, FourierSeries):
            count = 8 * max(NODES, self.degree)
            return np.asarray(self(T * np.arange(count) / count).mean(axis=0))
        x, w = np.polynomial.legendre.leggauss(NODES)
        h = np.diff(edges)[:, None]
        t = (edges[:-1, None] + h * (x + 1) / 2).ravel()
        return np.einsum("t,tij->ij", (h * w / (2 * T)).ravel(), self(t))

    @property
    def series(self) -> Series:
        """The series of [M D K]."""
        return self.blocks.series

    @property
    def breaks(self) -> tuple[float, ...]:
        """Named and found places in [0, T) where M, D or K is not smooth."""
        return self.blocks.breaks

    @property
    def found(self) -> tuple[Discontinuity, ...]:
        """Those that were not named."""
        return self.blocks.found

    @property
    def samples(self) -> int:
        """How often M, D, K were evaluated."""
        return self.blocks.samples


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
    return (HIDDEN * weight * (weight / np.where(across > 0, across, 1.0))).reshape(n, 3 * n)
