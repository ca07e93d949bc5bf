"""The largest sizes of many samples, by compiled code where there is a compiler."""

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address
from flexlin.periodic.native.library import find_library

FEW = 4096
"""Numbers up to which NumPy is as fast."""


def largest_sizes(rows: Array) -> Array:
    """Return the largest size in each column of rows (N, E), N >= 1: (E,); no numbers where some sample is not finite."""
    library = None if rows.size < FEW or not rows.flags.c_contiguous else find_library()
    if library is not None:
        sizes = np.empty(rows.shape[1])
        if not library.find_sizes(*rows.shape, address(rows), address(sizes)):
            raise MemoryError("the sizes of samples")
        return sizes
    sizes = np.abs(rows).max(axis=0)
    return sizes if np.isfinite(sizes).all() else np.full_like(sizes, np.nan)
