"""Identities that every Floquet analysis must satisfy, on random periodic systems."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flexlin as fl
from flexlin import floquet as floquet_of
from flexlin.checks import memory_limit
from flexlin.errors import TooManySegments
from flexlin.periodic import METHODS, match_logs
from tests.periodic.systems import random_waves


def random_system(seed, n):
    """Two harmonics with entries of order one, T = 2 pi."""
    return fl.PeriodicSystem(random_waves(np.random.default_rng(seed), n, n, 2, 1.0, 2 * np.pi)[0], 2 * np.pi)


def apart(first, second, period):
    return match_logs(first * period, second * period)[1].max() / period


systems = given(seed=st.integers(0, 10_000), n=st.integers(1, 5))


@settings(max_examples=15, deadline=None, derandomize=True)
@systems
def test_identities(seed, n):
    """A shift of A shifts every exponent, the adjoint system has the negative ones; another start and two periods change none."""
    system = random_system(seed, n)
    base, T = floquet_of(system), system.period
    related = {
        "shift": (lambda t: system.A(t) - 0.7 * np.eye(n), T, base.exponents - 0.7),
        "adjoint": (lambda t: -np.swapaxes(system.A(t), 1, 2), T, -base.exponents),
        "another start": (lambda t: system.A(t + 1.234), T, base.exponents),
        "two periods": (system.A, 2 * T, base.exponents),
    }
    for name, (A, period, expected) in related.items():
        found = floquet_of(fl.PeriodicSystem(A, period))
        assert apart(found.exponents, expected, period) <= base.error + found.error, name


@pytest.mark.slow
@settings(max_examples=10, deadline=None, derandomize=True)
@systems
def test_all_methods_agree(seed, n):
    system = random_system(seed, n)
    base = floquet_of(system)
    for method in (*METHODS, "hill"):
        other = floquet_of(system, tol=1e-7, method=method)
        resolved = np.isfinite(other.errors)
        distance = match_logs(other.log_multipliers, base.log_multipliers)[1] / system.period
        assert distance[resolved].max() <= other.error + base.error, method


def test_the_memory_of_the_factors_is_bounded():
    with memory_limit(1000 * 9), pytest.raises(TooManySegments, match="segments"):
        floquet_of(random_system(1, 3))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.97, 0.9])
def test_a_few_segments_too_few_cost_accuracy_and_no_answer(seed, share):
    system = random_system(seed, 4)
    needed, best = floquet_of(system).setting.segments, floquet_of(system, tol=1e-11)
    found = floquet_of(system, max_segments=int(share * needed))
    missed = match_logs(found.log_multipliers, best.log_multipliers)[1] / system.period
    assert found.setting.method == "gauss"
    assert found.setting.segments < needed
    assert np.all(missed <= found.errors + best.errors)
    assert found.error < 1e-7
