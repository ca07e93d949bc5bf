"""How small an entry of M, D or K may be before rounding of its neighbours hides it."""

import numpy as np

from flexlin.checks import Array

HIDDEN = 1e-3
"""An entry is resolved to 1e-13 of this share of its weight, or of its own size where that is larger: no worse than rounding."""


def weigh_entries(M: Array, D: Array, K: Array) -> Array:
    """Sizes (n, 3 n) below which the entries of [M D K], sampled as (N, n, n) each, need not be known to many digits.

        M_ij ~ sqrt(M_ii M_jj),   K_ij ~ sqrt(K_ii K_jj),   D_ij ~ sqrt(M_ij K_ij)

    A change of 1e-16 of these is what rounding of the diagonals makes (in coordinates scaled to the same inertia). What two expressions
    cancel to, where an entry ought to be zero, is noise; its digits are not followed. An entry counts for more where the one across the
    diagonal is large, since exponents depend on their product.
    """
    inertia, stiffness = (np.sqrt(np.abs(np.diagonal(A, axis1=1, axis2=2)).max(axis=0)) for A in (M, K))
    m, k = np.outer(inertia, inertia), np.outer(stiffness, stiffness)
    weights = []
    for A, weight in ((M, m), (D, np.sqrt(m * k)), (K, k)):
        across = np.maximum(np.abs(A).max(axis=0).T, weight)
        weights.append(weight * np.divide(weight, across, out=np.zeros_like(weight), where=across > 0))
    return HIDDEN * np.concatenate(weights, axis=1)
