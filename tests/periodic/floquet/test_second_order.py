"""Random systems of second order in unlike units, and modes that decay much faster than the others: claims against another method."""

import numpy as np
import pytest

import flexlin as fl
from tests.periodic.judge import covers
from tests.periodic.systems import waving_arm


def second_order(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    units = 10.0 ** rng.integers(-4, 4, n)
    return waving_arm(rng, [5 * np.eye(n), np.eye(n), 30 * np.eye(n)], 3 * [0.3], units)


def damped_fast(damping):
    wave = lambda t: np.sin(2 * np.pi * t)[:, None, None] * np.array([[0.2, 0.1], [0.1, -0.3]])  # noqa: E731
    mass, stiffness = (lambda t: np.eye(2) + wave(t)), (lambda t: 20 * np.eye(2) + 9 * wave(t))
    return fl.PeriodicSystem.from_second_order(mass, np.diag([damping, 1.0]), stiffness, 1.0, complete=True)


@pytest.mark.parametrize(
    ("system", "tol"),
    [pytest.param(second_order(seed), 10.0 ** -(5 + seed % 6), id=str(seed)) for seed in range(20, 32)]
    + [pytest.param(damped_fast(damping), 1e-9, id=f"damping {damping}") for damping in (30.0, 60.0)],
)
def test_no_exponent_is_further_off_than_its_error(system, tol):
    """Against segments of another order at a smaller tol."""
    found, other = fl.floquet(system, tol), fl.floquet(system, 1e-13, method="gauss", order=12)
    assert covers(found, other.exponents, 1.0, other.errors)
    assert (found.errors <= tol * np.maximum(1, np.abs(found.exponents))).all()
