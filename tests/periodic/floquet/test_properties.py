"""Identities that every Floquet analysis must satisfy, on random periodic systems."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.checks import memory_limit
from flexlin.errors import TooManySegments
from flexlin.periodic import METHODS
from tests.periodic.judge import covers
from tests.periodic.systems import random_waves
from tests.thinned import thin


def random_system(seed, n):
    """Two harmonics with entries of order one, T = 2 pi."""
    return fl.PeriodicSystem(random_waves(np.random.default_rng(seed), n, n, 2, 1.0, 2 * np.pi)[0], 2 * np.pi)


@pytest.mark.parametrize("seed", thin(range(15), 4))
def test_identities(seed):
    """A shift of A shifts every exponent, the adjoint system has the negative ones; another start and two periods change none."""
    system = random_system(seed, 1 + seed % 5)
    base, T = fl.floquet(system), system.period
    related = {
        "shift": (lambda t: system.A(t) - 0.7 * np.eye(system.n), T, base.exponents - 0.7),
        "adjoint": (lambda t: -np.swapaxes(system.A(t), 1, 2), T, -base.exponents),
        "another start": (lambda t: system.A(t + 1.234), T, base.exponents),
        "two periods": (system.A, 2 * T, base.exponents),
    }
    for name, (A, period, expected) in related.items():
        assert covers(fl.floquet(fl.PeriodicSystem(A, period)), expected, period, base.errors), name


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_all_methods_agree(seed):
    system = random_system(seed, 1 + seed % 5)
    base = fl.floquet(system)
    for method in (*METHODS, "hill"):
        other = fl.floquet(system, tol=1e-7, method=method)
        assert covers(other, base.exponents, system.period, base.errors), method
        assert other.error < 1e-6, method


def test_the_memory_of_the_factors_is_bounded():
    with memory_limit(1000 * 9), pytest.raises(TooManySegments, match="segments"):
        fl.floquet(random_system(1, 3))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.97, 0.9])
def test_a_few_segments_too_few_cost_accuracy_and_no_answer(seed, share):
    system = random_system(seed, 4)
    needed, best = fl.floquet(system).setting.segments, fl.floquet(system, tol=1e-11)
    found = fl.floquet(system, max_segments=int(share * needed))
    assert found.setting.method == "gauss"
    assert found.setting.segments < needed
    assert covers(found, best.exponents, system.period, best.errors)
    assert found.error < 1e-7
