"""Modes that take turns in being damped less: which one a multiplier follows cannot be seen, and may not be claimed.

w'' = q(t) w with q a polynomial in exp(i t): only one sign of harmonics, so the exponents are +-sqrt(q_0) exactly, whatever the eigenvalues
+-sqrt(q(t)) do on the way (Berry, Uzdin, J. Phys. A 44 (2011), 435303).
Where roots of q lie inside the unit circle, their means are others.
"""

import numpy as np
import pytest

from flexlin.periodic import Refusal, as_real, decouple, decoupled_exponents
from tests.periodic.judge import covers

PERIOD = 2 * np.pi


def cycling(rate, roots):
    """w' = (20 i r - 3 r + [0, r; r q, 0]) w in real form, q = prod (exp(i t) - root), and its exponents."""
    height = 20 * rate * max(1.0, np.prod([1 + abs(root) for root in roots]))

    def A(t):
        q = np.prod([np.exp(1j * np.asarray(t)) - root for root in roots], axis=0)
        B = np.zeros((len(q), 2, 2), complex)
        B[:, 0, 1], B[:, 1, 0] = rate, rate * q
        return as_real(B + (1j * height - 3 * rate) * np.eye(2))

    split = rate * np.sqrt(complex(np.prod([-root for root in roots])))
    own = 1j * height - 3 * rate + np.array([split, -split])
    return A, np.concatenate([own, own.conj()])


@pytest.mark.parametrize(
    "roots", [(0.2, 0.5j), (0.3, -0.3), (0.1, 0.15), (-0.5, 0.2j, 1.6), (3.0, -3.0), (2.0,), (0.3,)]
)
@pytest.mark.parametrize("rate", [6.0, 60.0, 600.0])
def test_means_of_followed_modes_are_not_claimed_where_others_may_be_followed(roots, rate):
    A, exponents = cycling(rate, roots)
    decoupled = decouple(A, PERIOD, tol=1e-8)
    if isinstance(decoupled, Refusal):
        return
    answer = decoupled_exponents(decoupled)
    assert covers(answer, exponents, PERIOD)
    assert (answer.exponents.real + answer.errors < 0).all()  # enclosed well enough for a verdict
