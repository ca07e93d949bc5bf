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


def second_order(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    parts, units = [wavy(rng, (n, n), 0.4) for _ in range(3)], 10.0 ** rng.integers(-4, 4, n)
    fixed = np.array([5 * np.eye(n), np.eye(n), 30 * np.eye(n)])

    def part(k):
        return lambda t: (fixed[k] + 0.3 * parts[k](t)) * units * units[:, None]

    return fl.PeriodicSystem.from_second_order(part(0), part(1), part(2), 1.0, complete=True)


@compiled
def test_compiled_code_and_numpy_find_the_same(monkeypatch):
    served = 0
    for seed in range(12):
        one = solve_at_once(second_order(seed), 1e-9)
        with monkeypatch.context() as patch:
            patch.setattr(floquet_decoupled, "find_steady_solver", lambda states: None)
            other = solve_at_once(second_order(seed), 1e-9)
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


@pytest.mark.parametrize("compiler", [True, False])
def test_no_exponent_is_further_off_than_its_error(compiler, monkeypatch):
    """Against segments of another order at a smaller tol."""
    if not compiler:
        monkeypatch.setattr(floquet_decoupled, "find_steady_solver", lambda states: None)
    served = 0
    for seed in range(20, 40 if compiler else 26):
        system = second_order(seed)
        found = solve_at_once(system, 10.0 ** -(5 + seed % 6))
        if isinstance(found, Refusal) or found[2].method != "gauss":
            continue
        served += 1
        other = fl.floquet(system, 1e-13, method="gauss", order=12)
        partner, apart = match_logs(found[0], other.exponents)
        assert (apart <= found[1] + other.errors[partner]).all(), seed
    assert served >= (10 if compiler else 3)


def test_modes_that_grow_by_three_measures_and_systems_of_first_order_are_left_to_others():
    wave = lambda t: 0.2 * np.sin(2 * np.pi * t)[:, None, None]  # noqa: E731
    stiff = fl.PeriodicSystem.from_second_order(lambda t: np.eye(2) + wave(t), np.diag([40.0, 90.0]), np.eye(2), 1.0)
    first = fl.PeriodicSystem(lambda t: np.array([[-1.0, 1.0], [-1.0, -1.0]]) + wave(t), 1.0)
    for system in (stiff, first):
        found = solve_at_once(system, 1e-9)
        assert isinstance(found, Refusal) or found[2].method != "gauss"


@pytest.mark.parametrize("compiler", [True, False])
@pytest.mark.parametrize("damping", [30.0, 60.0])
def test_a_mode_that_decays_much_faster_than_the_others_is_followed_backward(compiler, damping, monkeypatch):
    if not compiler:
        monkeypatch.setattr(floquet_decoupled, "find_steady_solver", lambda states: None)
    wave = lambda t: np.sin(2 * np.pi * t)[:, None, None] * np.array([[0.2, 0.1], [0.1, -0.3]])  # noqa: E731
    system = fl.PeriodicSystem.from_second_order(
        lambda t: np.eye(2) + wave(t),
        np.diag([damping, 1.0]),
        lambda t: 20 * np.eye(2) + 9 * wave(t),
        1.0,
        complete=True,
    )
    exponents, errors, setting, _ = solve_at_once(system, 1e-9)
    assert setting.method == "gauss"
    assert np.ptp(exponents.real) > 24
    other = fl.floquet(system, 1e-13, method="gauss", order=12)
    partner, apart = match_logs(exponents, other.exponents)
    assert (apart <= errors + other.errors[partner]).all()
    assert (errors <= 1e-9 * np.maximum(1, np.abs(exponents))).all()
