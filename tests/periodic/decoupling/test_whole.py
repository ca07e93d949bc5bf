"""Exponents from few segments of the whole period: compiled code against NumPy, and both against known exponents."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic.circle import match_logs
from flexlin.periodic.decoupling.decoupled import Refusal
from flexlin.periodic.floquet import decoupled as floquet_decoupled
from flexlin.periodic.floquet.decoupled import solve_at_once
from flexlin.periodic.native.library import find_library

compiled = pytest.mark.skipif(find_library() is None, reason="there is no C compiler")


def wavy(rng, shape, decay):
    """A random function of the period 1 with a few harmonics."""
    mean, waves = rng.normal(size=shape), rng.normal(size=(2, 4, *shape)) * decay ** np.arange(4)[:, None, None]

    def values(t):
        angle = 2 * np.pi * np.outer(t, np.arange(1, 5))
        return mean + np.tensordot(np.cos(angle), waves[0], 1) + np.tensordot(np.sin(angle), waves[1], 1)

    return values


def first_order(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    A, units = wavy(rng, (n, n), 0.4), 10.0 ** rng.integers(-4, 4, n)
    return fl.PeriodicSystem(lambda t: A(t) * (units[:, None] / units), 1.0, complete=True)


def second_order(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    parts, units = [wavy(rng, (n, n), 0.4) for _ in range(3)], 10.0 ** rng.integers(-4, 4, n)
    fixed = np.array([5 * np.eye(n), np.eye(n), 30 * np.eye(n)])

    def part(k):
        return lambda t: (fixed[k] + 0.3 * parts[k](t)) * units * units[:, None]

    return fl.PeriodicSystem.from_second_order(part(0), part(1), part(2), 1.0, complete=True)


@compiled
@pytest.mark.parametrize("make", [first_order, second_order])
def test_compiled_code_and_numpy_find_the_same(make, monkeypatch):
    served = 0
    for seed in range(12):
        one = solve_at_once(make(seed), 1e-9)
        with monkeypatch.context() as patch:
            patch.setattr(floquet_decoupled, "find_steady_solver", lambda states: None)
            other = solve_at_once(make(seed), 1e-9)
        assert isinstance(one, Refusal) == isinstance(other, Refusal)
        if isinstance(one, Refusal) or isinstance(other, Refusal):
            continue
        assert one[2].method == other[2].method
        assert one[2].segments == other[2].segments
        served += one[2].method == "gauss"
        partner, apart = match_logs(one[0], other[0])
        assert (apart <= 0.5 * (one[1] + other[1][partner])).all(), seed
        assert (np.abs(one[1] - other[1][partner]) <= 0.6 * other[1][partner] + 1e-11).all(), (
            seed
        )  # units by powers of 2
    assert served >= 6


def transformed(seed):
    """x = P(t) y with y' = C y: A = P' P^-1 + P C P^-1 has the exponents of C. C is far from normal for some."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    C = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-1, 1) + np.triu(
        rng.normal(size=(n, n)), 1
    ) * 10.0 ** rng.uniform(-1, 2)
    waves, turns = rng.uniform(0.05, 0.2) * rng.normal(size=(2, n, n)), rng.integers(1, 3, 2)

    def A(t):
        angle = 2 * np.pi * np.outer(t, turns)
        P = np.eye(n) + np.tensordot(np.sin(angle), waves, 1)
        slope = np.tensordot(2 * np.pi * turns * np.cos(angle), waves, 1)
        return np.linalg.solve(np.swapaxes(P, 1, 2), np.swapaxes(slope + P @ C, 1, 2)).swapaxes(1, 2)

    return fl.PeriodicSystem(A, 1.0, complete=True), np.linalg.eigvals(C)


@pytest.mark.parametrize("compiler", [True, False])
def test_no_exponent_is_further_off_than_its_error(compiler, monkeypatch):
    if not compiler:
        monkeypatch.setattr(floquet_decoupled, "find_steady_solver", lambda states: None)
    served = 0
    for seed in range(40 if compiler else 10):
        system, truth = transformed(seed)
        found = solve_at_once(system, 10.0 ** -(5 + seed % 6))
        if isinstance(found, Refusal):
            continue
        served += found[2].method == "gauss"
        apart = match_logs(found[0], truth)[1]
        assert (apart <= found[1]).all(), (seed, apart, found[1])
    assert served >= (15 if compiler else 4)


def test_modes_that_grow_against_each_other_by_too_much_are_left_to_others():
    A = np.diag([-1.0, -30.0])
    found = solve_at_once(fl.PeriodicSystem(lambda t: A + 0.2 * np.sin(2 * np.pi * t)[:, None, None], 1.0), 1e-9)
    assert isinstance(found, Refusal) or found[2].method != "gauss"
