"""Second-order coefficients M, D, K over one period, the state matrix that they make, and what either is not known by."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries, fourier_nodes
from flexlin.periodic.precision import EPS
from flexlin.periodic.resolved.matrix import Resolved, ResolvedMatrix
from flexlin.periodic.resolved.panels import NODES
from flexlin.periodic.resolved.sampling import ROUNDINGS
from flexlin.periodic.second_order import build_companion


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
        return build_companion(*self.sample(t), t)

    def mean(self) -> Array:
        """The integral of A over the period, divided by T, by quadrature."""
        edges, T = self.edges, self.period
        if isinstance(self.series, FourierSeries):
            count = 8 * max(NODES, self.degree)
            return np.asarray(
                build_companion(*self.split(self.series.at_nodes(count)), fourier_nodes(count, T)).mean(axis=0)
            )
        x, w = np.polynomial.legendre.leggauss(NODES)
        h = np.diff(edges)[:, None]
        t = (edges[:-1, None] + h * (x + 1) / 2).ravel()
        return np.einsum("t,tij->ij", (h * w / (2 * T)).ravel(), self(t))


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
        known = ROUNDINGS * EPS * np.abs(resolved(t)) + error
        return np.asarray(np.abs(left) @ (known @ np.abs(right)))
    M, D, K = resolved.sample(t)
    n = M.shape[-1]
    dM, dD, dK = (ROUNDINGS * EPS * np.abs(X) + e for X, e in zip((M, D, K), resolved.split(error), strict=True))
    V = np.swapaxes(np.linalg.solve(np.swapaxes(M, -1, -2), np.swapaxes(left[..., n:], -1, -2)), -1, -2)
    position, rate = right[..., :n, :], right[..., n:, :]
    z = np.linalg.solve(M, K @ position + D @ rate)
    return np.asarray(np.abs(V) @ (dM @ np.abs(z) + dD @ np.abs(rate) + dK @ np.abs(position)))
