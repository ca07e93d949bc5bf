"""How far a Fourier series is from its function at the check points: eight times at once."""

from functools import lru_cache

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.periodic.fourier import fourier_basis
from flexlin.periodic.resolved.sampling import CheckPoints, usual_phases

COMPARE = declare(
    "int compare_series(long count, int entries, int H, const double *cosines, const double *sines, const double *coefficients, "
    "const double *values, double *worst)",
    lambda count, entries, H, *_: ((count,), (count,), (2 * H + 1, entries), (count, entries), (entries,)),
)


def find_deviation(coefficients: Array, checks: CheckPoints) -> Array:
    """The largest deviation of a series (2 H + 1, E) from A at `usual_phases` (E,).

    Raises: MemoryError.
    """
    worst = np.zeros(coefficients.shape[1])
    coefficients = np.ascontiguousarray(coefficients)
    for part, values in checks.batches():
        given = (*first_waves()[:, part], coefficients, np.ascontiguousarray(values), worst)
        if not COMPARE(len(values), len(worst), len(coefficients) // 2, *given):
            raise MemoryError("the series of a period")
    return worst


@lru_cache(maxsize=1)
def first_waves() -> Array:
    """Cosine and sine of one turn a period at the check points, (2, N)."""
    return np.ascontiguousarray(fourier_basis(usual_phases(), 1)[:, 1:].T)
