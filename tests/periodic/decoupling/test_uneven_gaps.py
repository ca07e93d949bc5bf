"""Fast modes whose gap varies by much, states in unlike units, and what rounding hides: known exponents by a change of coordinates."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic.circle import match_logs
from flexlin.periodic.decoupling import whole
from flexlin.periodic.decoupling.decoupled import Refusal
from flexlin.periodic.floquet import decoupled as routes
from flexlin.periodic.floquet import exponents as floquet_exponents
from flexlin.periodic.native.library import find_library
from tests.periodic.gentle import gentle_system

T = 2.0


class Turned:
    """x = P(t) y, y' = D(t) y: D with blocks [[a, b], [-b, a]] of given rates, P = exp of a small wave of a random matrix."""

    def __init__(self, growth, turning, size=0.02, seed=0, units=1.0):
        self.growth, self.turning = growth, turning
        self.n = 2 * len(growth)
        self.wave = size * np.random.default_rng(seed).standard_normal((self.n, self.n))
        self.units = np.asarray(units) * np.ones(self.n)

    def __call__(self, t):
        s, w = np.sin(2 * np.pi * t / T), 2 * np.pi / T * np.cos(2 * np.pi * t / T)
        values, vectors = np.linalg.eig(self.wave)
        P, inverse = (
            ((vectors * np.exp(sign * values * s[:, None])[:, None]) @ np.linalg.inv(vectors)).real for sign in (1, -1)
        )
        D = np.zeros((len(t), self.n, self.n))
        for k, (a, b) in enumerate(zip(self.growth, self.turning, strict=True)):
            i = 2 * k
            D[:, i, i] = D[:, i + 1, i + 1] = a(t)
            D[:, i, i + 1] = b(t)
            D[:, i + 1, i] = -b(t)
        A = P @ D @ inverse + w[:, None, None] * self.wave
        return A * (self.units[:, None] / self.units)

    @property
    def exponents(self):
        t = T / 4096 * np.arange(4096)
        means = [a(t).mean() + 1j * b(t).mean() for a, b in zip(self.growth, self.turning, strict=True)]
        return np.ravel([[mean, np.conj(mean)] for mean in means])


def wave(mean, share, phase=0.0):
    return lambda t: mean * (1 + share * np.cos(2 * np.pi * t / T + phase))


UNEVEN = [wave(-1.0, 0.0), wave(-3.0, 0.0), wave(-5.0, 0.0)], [wave(2.0, 0.0), wave(700.0, 0.1), wave(1500.0, 0.35)]
"""The gap of the fast modes goes from 300 to 1300 1/s while the motion has 3 1/s."""
routes_taken = pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "NumPy"])


def prepare(monkeypatch, compiled):
    if compiled and find_library() is None:
        pytest.skip("there is no C compiler")
    monkeypatch.setattr(whole, "FIRST", 0)
    monkeypatch.setattr(whole, "MOST", 0)
    if not compiled:
        monkeypatch.setattr(routes, "find_steady_solver", lambda states: None)


def check_claim(found, exact):
    partner, apart = match_logs(found[0] * T, exact * T)
    assert (apart / T <= found[1]).all()
    assert sorted(partner) == list(range(len(exact)))


@routes_taken
@pytest.mark.parametrize("seed", range(4))
def test_a_fast_gap_may_vary_by_much(monkeypatch, compiled, seed):
    """Few rounds: each leaves the rate of change over the gap, not what the gap differs from its mean by (12 rounds and more)."""
    prepare(monkeypatch, compiled)
    system = Turned(*UNEVEN, seed=seed)
    found = routes.solve_at_once(fl.PeriodicSystem(system, T), 1e-9)
    assert not isinstance(found, Refusal)
    assert found[3].rounds <= 6
    check_claim(found, system.exponents)


@routes_taken
def test_units_of_the_states_do_not_matter(monkeypatch, compiled):
    prepare(monkeypatch, compiled)
    units = 10.0 ** np.array([0, 5, -3, 2, 4, -1])
    plain, scaled = (Turned(*UNEVEN, units=each) for each in (1.0, units))
    for system in (plain, scaled):
        found = routes.solve_at_once(fl.PeriodicSystem(system, T), 1e-8)
        assert not isinstance(found, Refusal)
        check_claim(found, system.exponents)


@pytest.mark.skipif(find_library() is None, reason="there is no C compiler")
def test_what_rounding_hides_is_not_sought_a_second_time(monkeypatch):
    """Two modes that take turns in damping by exp(25): no other nodes make their exponents surer, so the answer stands."""

    def refuse(*arguments):
        raise AssertionError("decoupled anew")

    prepare(monkeypatch, True)
    taking_turns = (
        [wave(-1.0, 0.0), wave(-90.0, 0.35), wave(-90.0, -0.35)],
        [wave(2.0, 0.0), wave(9e3, 0.01), wave(3e4, 0.0)],
    )
    system = Turned(*taking_turns, size=0.005)
    missed = routes.solve_at_once(fl.PeriodicSystem(system, T), 1e-9)
    assert isinstance(missed, routes.HiddenMiss)
    assert missed.answer is not None
    monkeypatch.setattr(floquet_exponents, "try_decoupling", refuse)
    found = fl.floquet(fl.PeriodicSystem(system, T), 1e-9, max_segments=100)
    assert found.setting.method == "decoupling"
    assert found.verdict == "stable"
    check_claim((found.exponents, found.errors), system.exponents)


def test_where_the_leading_modes_are_hidden_other_ways_are_tried(monkeypatch):
    """Their enclosure by the frame of followed modes is six times as narrow."""
    prepare(monkeypatch, True)
    gentle = gentle_system(10)
    missed = routes.solve_at_once(fl.PeriodicSystem(gentle, gentle.period, complete=True), 1e-4)
    assert isinstance(missed, routes.HiddenMiss)
    assert missed.answer is None
    assert fl.floquet(fl.PeriodicSystem(gentle, gentle.period, complete=True), 1e-4).error < 10
