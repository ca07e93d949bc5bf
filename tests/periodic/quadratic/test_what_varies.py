"""Each coefficient of a linear-quadratic problem may be constant or vary, whatever the others do: X against SciPy's DOP853."""

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl

T = 2.0
KINDS = list(product([False, True], repeat=5))


def waving(matrix: np.ndarray, share: float, phase: float):
    """The matrix times 1 + share cos(2 pi t / T + phase), as a function of times."""
    return lambda t: matrix * (1 + share * np.cos(2 * np.pi * np.atleast_1d(t) / T + phase))[:, None, None]


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [1.0, 40.0])
@pytest.mark.parametrize("varying", KINDS, ids=lambda v: "".join("cv"[x] for x in v))
def test_any_coefficient_may_vary(varying: tuple[bool, ...], frequency: float) -> None:
    plain = (
        np.array([[-0.1, 1.0], [-(frequency**2), -0.3]]),
        np.array([[0.2], [1.0]]),
        np.array([[2.0, 0.3], [0.3, 1.0]]),
        np.array([[0.7]]),
        np.array([[0.1], [0.2]]),
    )
    A, B, Q, R, N = (
        waving(one, 0.2 if varies else 0.0, float(k))
        for k, (one, varies) in enumerate(zip(plain, varying, strict=True))
    )
    given = [f if varies else one for f, one, varies in zip((A, B, Q, R, N), plain, varying, strict=True)]
    solution = fl.periodic_lqr(fl.PeriodicSystem(given[0], T, given[1]), *given[2:]).solution

    def backward(s: float, flat: np.ndarray) -> np.ndarray:
        X, t = flat.reshape(2, 2), T - s
        a, b, q, r, n = (f(t)[0] for f in (A, B, Q, R, N))
        K = np.linalg.solve(r, b.T @ X + n.T)
        return (a.T @ X + X @ a - (X @ b + n) @ K + q).ravel()

    end = solution.X(np.zeros(1))[0]
    start = solve_ivp(backward, (0.0, T), end.ravel(), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1].reshape(2, 2)
    size = np.abs(end).max()
    assert np.abs(start - end).max() <= (solution.error + 1e-9) * size
    assert solution.error < 1e-9
