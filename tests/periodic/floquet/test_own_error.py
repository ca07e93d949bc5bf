"""The error that floquet reports against the true error, over random systems with known exponents."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic import match_logs
from tests.periodic.jumping_systems import Piecewise
from tests.periodic.truths import switched_exponents


def switched_triangular(seed):
    """Turned triangular matrices one after the other (breaks not named), and their exponents from exact exponentials."""
    rng = np.random.default_rng(seed)
    T, count = 10 ** rng.uniform(-1, 1), int(rng.integers(2, 5))
    starts = np.append(0.0, np.sort(T * rng.uniform(0, 1, count - 1)))
    parts = []
    for _ in starts:
        U = np.triu(10 ** rng.uniform(1.5, 6) * rng.standard_normal((3, 3)), 1) - np.diag(10 ** rng.uniform(-1, 1, 3))
        Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        parts.append(Q @ U @ Q.T / (10 * T))
    system = fl.PeriodicSystem(Piecewise(starts, T, np.array(parts)), T)
    return system, switched_exponents(parts, [*starts, T])


@pytest.mark.parametrize(
    ("seed", "tol"), [(k, 1e-9) for k in (66, 109, 134, 164)] + [(k, 1e-4) for k in (412, 440, 608, 673)]
)
def test_rounding_is_covered(seed, tol):
    """Of non-normal factors, where two methods may agree by accident: missed by 2.1 to 2.7 times their error. And of stretched segments,
    where h |A| is far above h |lambda| and the stages cancel: by 3.5 to 5.8 times."""
    system, known = switched_triangular(seed)
    result = fl.floquet(system, tol)
    apart = match_logs(result.log_multipliers, known * system.period)[1] / system.period
    assert np.all(apart <= result.errors)
    assert tol < 1e-5 or result.error < 1e-2


def test_bounds_beyond_the_range_of_numbers_are_numbers_that_decide_nothing():
    """Errors were not-a-number here, with a warning of NumPy's, and the verdict "zero to within its error"."""
    rng, n = np.random.default_rng(16), 6
    U = np.triu(10 ** rng.uniform(3, 6) * rng.standard_normal((n, n)), 1) - np.diag(10 ** rng.uniform(-1, 1, n))
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    C, T = Q @ U @ Q.T, 10 ** rng.uniform(0, 1.5)
    result = fl.floquet(fl.PeriodicSystem(lambda t: (1 + 0.5 * np.sin(2 * np.pi * t / T))[:, None, None] * C, T))
    assert np.isfinite(result.errors).all()
    assert (result.verdict, result.reason[:36]) == ("undecided", "double precision cannot decide: roun")
