"""Identities that every Floquet analysis must satisfy, on random periodic systems."""

from importlib import import_module

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flexlin as fl
from flexlin import floquet as floquet_of
from flexlin.errors import TooManySegments
from flexlin.periodic import METHODS, match_logs


def random_system(seed, n):
    """A trigonometric polynomial of degree 2 with entries of order one, T = 2 pi."""
    C = np.random.default_rng(seed).standard_normal((5, n, n))

    def A(t):
        basis = np.stack([np.ones_like(t), np.cos(t), np.sin(t), np.cos(2 * t), np.sin(2 * t)])
        return np.einsum("kt,kij->tij", basis, C)

    return fl.PeriodicSystem(A, 2 * np.pi)


def apart(first, second, period):
    return match_logs(first * period, second * period)[1].max() / period


systems = given(seed=st.integers(0, 10_000), n=st.integers(1, 5))


@settings(max_examples=15, deadline=None, derandomize=True)
@systems
def test_a_shift_of_A_shifts_every_exponent(seed, n):
    system = random_system(seed, n)
    base = floquet_of(system)
    moved = floquet_of(fl.PeriodicSystem(lambda t: system.A(t) - 0.7 * np.eye(n), system.period))
    assert apart(moved.exponents, base.exponents - 0.7, system.period) <= base.error + moved.error


@settings(max_examples=15, deadline=None, derandomize=True)
@systems
def test_the_adjoint_system_has_the_negative_exponents(seed, n):
    system = random_system(seed, n)
    base = floquet_of(system)
    adjoint = floquet_of(fl.PeriodicSystem(lambda t: -np.swapaxes(system.A(t), 1, 2), system.period))
    assert apart(adjoint.exponents, -base.exponents, system.period) <= base.error + adjoint.error


@settings(max_examples=15, deadline=None, derandomize=True)
@systems
def test_a_start_at_another_phase_changes_nothing(seed, n):
    system = random_system(seed, n)
    base = floquet_of(system)
    late = floquet_of(fl.PeriodicSystem(lambda t: system.A(t + 1.234), system.period))
    assert apart(late.exponents, base.exponents, system.period) <= base.error + late.error


@settings(max_examples=10, deadline=None, derandomize=True)
@systems
def test_two_periods_double_the_logs(seed, n):
    system = random_system(seed, n)
    base = floquet_of(system)
    twice = floquet_of(fl.PeriodicSystem(system.A, 2 * system.period))
    assert apart(twice.exponents, base.exponents, twice.period) <= base.error + twice.error


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


def test_the_memory_of_the_factors_is_bounded(monkeypatch):
    module = import_module("flexlin.periodic.floquet.exponents")  # the function has the same name
    monkeypatch.setattr(module, "FACTOR_BYTES", 8 * 9 * 6)
    with pytest.raises(TooManySegments, match="segments"):
        floquet_of(random_system(1, 3))
