"""How small an entry of M, D or K may be before rounding of its neighbours hides it."""

import numpy as np

from flexlin.checks import Array

HIDDEN = 1e-3
"""An entry is resolved to 1e-13 of this share of its weight, or of its own size where that is larger: no worse than rounding."""


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
    m, k = inertia[:, None] * inertia, stiffness[:, None] * stiffness
    weight = np.stack([m, np.sqrt(m * k), k], axis=1)
    across = np.maximum(size.transpose(2, 1, 0), weight)
    share = np.divide(weight, across, out=np.zeros_like(weight), where=across > 0)
    return (HIDDEN * weight * share).reshape(n, 3 * n)
