"""How far a Fourier series is from its function at the check points: eight times at once by compiled code."""

from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address
from flexlin.periodic.fourier import fourier_basis
from flexlin.periodic.native.library import find_library
from flexlin.periodic.resolved.sampling import CheckPoints, usual_phases
from flexlin.periodic.resolved.sizes import largest_sizes


def find_deviation(coefficients: Array, checks: CheckPoints) -> Array:
    """The largest deviation of a series (2 H + 1, E) from A at `usual_phases` (E,).

    Raises: MemoryError.
    """
    library, H = find_library(), len(coefficients) // 2
    worst = np.zeros(coefficients.shape[1])
    coefficients = np.ascontiguousarray(coefficients)
    for part, values in checks.batches():
        if library is None:
            left = values - coefficients[0] - fourier_basis(usual_phases()[part], H)[:, 1:] @ coefficients[1:]
            np.maximum(worst, largest_sizes(left), out=worst)
            continue
        given = (*first_waves()[:, part], coefficients, np.ascontiguousarray(values), worst)
        if not library.compare_series(len(values), len(worst), H, *map(address, given)):
            raise MemoryError("the series of a period")
    return worst


@lru_cache(maxsize=1)
def first_waves() -> Array:
    """Cosine and sine of one turn a period at the check points, (2, N)."""
    return np.ascontiguousarray(fourier_basis(usual_phases(), 1)[:, 1:].T)
