"""The largest sizes of many samples, in one pass."""

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array

FIND = declare(
    "int find_sizes(long count, int entries, const double *rows, double *out)",
    lambda count, entries, *_: ((count, entries), (entries,)),
)


def largest_sizes(rows: Array) -> Array:
    """Return the largest size in each column of rows (N, E), N >= 1: (E,); no numbers where some sample is not finite."""
    sizes = np.empty(rows.shape[1])
    if not FIND(*rows.shape, np.ascontiguousarray(rows), sizes):
        raise MemoryError("the sizes of samples")
    return sizes
