"""Decoupling from the modes of the mean: against known exponents, between compiled code and NumPy, and what it leaves to others."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic.circle import match_logs
from flexlin.periodic.decoupling import whole
from flexlin.periodic.decoupling.coordinates import find_coordinates
from flexlin.periodic.decoupling.coupling import Coupled, residual_effect
from flexlin.periodic.decoupling.decoupled import Refusal
from flexlin.periodic.decoupling.mean_modes import find_mean_modes
from flexlin.periodic.decoupling.steady import bound_residual, decouple_steady, in_states
from flexlin.periodic.floquet import decoupled as floquet_decoupled
from flexlin.periodic.floquet.decoupled import solve_at_once
from flexlin.periodic.native.library import find_library
from flexlin.periodic.resolved import fitting
from tests.periodic.decoupling.test_decoupling import misses
from tests.periodic.gentle import gentle_system, lively_system

pytestmark = pytest.mark.usefixtures("by_decoupling_alone")
compiled = pytest.mark.skipif(find_library() is None, reason="there is no C compiler")


@pytest.fixture
def by_decoupling_alone(monkeypatch):
    """Not by few segments of the whole period."""
    monkeypatch.setattr(whole, "FIRST", 0)
    monkeypatch.setattr(whole, "MOST", 0)


def without_compiler(monkeypatch):
    monkeypatch.setattr(floquet_decoupled, "find_steady_solver", lambda states: None)
    monkeypatch.setattr(fitting, "find_library", lambda: None)


def as_system(gentle):
    return fl.PeriodicSystem(gentle, gentle.period, complete=True)


def coordinates_of(gentle, count=32):
    modes = find_mean_modes(gentle(gentle.period / 8 * np.arange(8)).mean(axis=0), 8 * np.pi / gentle.period)
    if isinstance(modes, Refusal):
        return None
    own = modes.left @ gentle(gentle.period / (2 * count) * np.arange(2 * count)) @ modes.right
    return own, modes, find_coordinates(own, modes, gentle.period, 1e-9 * np.maximum(1, np.abs(modes.values)))


def arm(modes, changes=None):
    scene = fl.load_scene("single-link", {"links.0.modes": modes, "designs": [], **(changes or {})})
    return fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)


def solved(make, tol, monkeypatch):
    """By compiled code, then by NumPy."""
    first = solve_at_once(make(), tol)
    with monkeypatch.context() as patch:
        without_compiler(patch)
        return first, solve_at_once(make(), tol)


@compiled
def test_compiled_code_and_numpy_find_the_same_coordinates_errors_and_exponents(monkeypatch):
    link = arm(2).periodic_system()
    makes = [lambda: fl.PeriodicSystem(link.A, link.period, None, (), link.second_order, (), True)]
    makes += [
        lambda seed=seed: as_system(gentle_system(seed, seed % 2 > 0)) for seed in (0, 3, 5, 16, 17, 18, 19, 28, 55)
    ]
    served = 0
    for make in makes:
        one, other = solved(make, 1e-8, monkeypatch)
        assert isinstance(one, Refusal) == isinstance(other, Refusal)
        if isinstance(one, Refusal) or isinstance(other, Refusal):
            continue
        served += 1
        a, b, size = one[3], other[3], np.abs(other[3].generator).max()
        assert a.rounds == b.rounds
        assert (np.abs(one[0] - other[0]) <= 1e-12 * size + 0.1 * other[1]).all()
        assert (np.abs(one[1] - other[1]) <= 0.5 * other[1] + 1e-14 * size).all()
        frame = np.abs(b.frame).max() * np.abs(b.inverse).max()
        assert np.abs(a.frame @ a.inverse - np.eye(len(one[0]))).max() <= 1e-13 * max(1, frame)
        apart = np.abs(np.einsum("tii->ti", a.generator) - np.einsum("tii->ti", b.generator)).max()
        assert apart <= 1e-12 * size * max(1, frame)
        assert np.abs(a.rounding - b.rounding).max() <= 0.6 * b.rounding.max()
        assert np.abs(a.residual - b.residual).max() <= 0.1 * b.residual.max() + 0.1 * other[1].max()
    assert served >= 7


@compiled
def test_compiled_code_and_numpy_follow_the_same_groups(monkeypatch):
    """Random groups of up to six modes beside a fast one, among them some that grow against each other by too much."""
    rng, served = np.random.default_rng(5), 0
    for p in (2, 2, 2, 3, 3, 4, 4, 6):
        mean = 0.3 * rng.normal(size=(p + 1, p + 1)) * 10 ** rng.uniform(-1, 0.5)
        mean[p, p] = -300.0
        wave = 0.1 * rng.normal(size=(2, p + 1, p + 1))

        def A(t, mean=mean, wave=wave):
            c, s = np.cos(np.pi * t)[:, None, None], np.sin(3 * np.pi * t)[:, None, None]
            return mean + c * wave[0] + s * wave[1]

        one, other = solved(lambda A=A: fl.PeriodicSystem(A, 2.0, complete=True), 1e-8, monkeypatch)
        assert isinstance(one, Refusal) == isinstance(other, Refusal)
        if isinstance(one, Refusal) or isinstance(other, Refusal):
            continue
        served += 1
        assert max(group.size for group in one[3].groups) > 1
        assert one[3].groups == other[3].groups
        partner, apart = match_logs(2.0 * one[0], 2.0 * other[0])
        assert (apart / 2.0 <= 1e-12 + 0.1 * other[1][partner]).all()
        assert (np.abs(one[1] - other[1][partner]) <= 0.5 * other[1][partner] + 1e-12).all()
    assert served >= 3


@compiled
def test_modes_that_a_harmonic_couples_are_put_together_alone(monkeypatch):
    """-11.8 +- 3.2 i in units of the basic frequency, in resonance with the sixth harmonic: the slow pair is left by itself."""
    link = arm(1, NEAR_RESONANCE).periodic_system()
    make = lambda: fl.PeriodicSystem(link.A, link.period, None, (), link.second_order, (), True)  # noqa: E731
    one, other = solved(make, 1e-10, monkeypatch)
    assert [group.size for group in one[3].groups] == [group.size for group in other[3].groups] == [2, 2]
    assert (np.abs(one[0] - other[0]) <= one[1] + other[1]).all()


@pytest.mark.parametrize("make", [gentle_system, partial(gentle_system, near_resonance=True), lively_system])
@pytest.mark.parametrize(
    ("seeds", "least"), [(range(5), 1), pytest.param(range(5, 45), 8, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_no_exponent_is_further_off_than_its_error(monkeypatch, seeds, least, make):
    """By compiled code and by NumPy."""
    systems = [make(seed) for seed in seeds]
    served = check_claims(systems)
    without_compiler(monkeypatch)
    assert abs(check_claims(systems) - served) <= 1  # one whose error is tol, up to rounding
    assert served >= least


def check_claims(systems):
    served = 0
    for k, gentle in enumerate(systems):
        tol = 10.0 ** -(4 + k % 7)
        found = solve_at_once(as_system(gentle), tol)
        if isinstance(found, Refusal):
            continue
        served += 1
        answer = SimpleNamespace(exponents=found[0], errors=found[1])
        assert (found[1] <= tol * np.maximum(1, np.abs(found[0]))).all()
        assert (misses(answer, gentle.exponents, gentle.period) <= found[1]).all(), k
    return served


NEAR_RESONANCE = {
    "links.0.length": 1.4514989414327564,
    "links.0.bending_stiffness": 5.76348022851932,
    "effects.payload.mass": 0.009204494307271176,
    "effects.modal_damping.ratio": 0.04466805189756285,
    "motion.frequency": 0.7286070043858148,
    "motion.joints": [{"mean": -0.4095314886746084, "amplitude": 0.9911682460300291}],
}
HARD_DRIVE = {
    "links.0.bending_stiffness": 12.388797456853958,
    "motion.frequency": 1.0400200303386022,
    "motion.joints": [{"mean": 0.7813837525671954, "amplitude": 1.9389085670418087}],
    "effects.payload.mass": 0.021919559665140278,
    "effects.modal_damping.ratio": 0.004038122123472825,
    "control.feedback": {"kind": "pd", "kp": [7.684278843470476], "kd": [1.5899715647696537]},
}
"""Eigenvectors of the mean, in metres and metres per second, of a joint mode that decays within a millisecond: their inverse needs care."""


@pytest.mark.parametrize(("modes", "changes"), [(2, {}), (3, HARD_DRIVE)], ids=["as it is", "hard drive"])
def test_segments_give_the_same_exponents(modes, changes):
    system = arm(modes, changes).periodic_system()
    found, other = fl.floquet(system, 1e-10), fl.floquet(system, 1e-10, method="gauss")
    assert "keep their shapes" in str(found.setting)
    partner, apart = match_logs(found.exponents * system.period, other.exponents * system.period)
    assert (apart / system.period <= found.errors + other.errors[partner]).all()
    assert found.error < 1e-8
    assert found.certificate().margin > 0


def test_what_is_left_of_the_coupling_is_bounded_as_by_the_equations_of_sylvester():
    for seed in range(6):
        gentle = gentle_system(seed)
        found = coordinates_of(gentle)
        if found is None or (bounds := bound_residual(found[2].generator, found[1], gentle.period)) is None:
            continue
        done, _ = in_states(found[2], found[1], gentle.period, bounds[0].copy())
        other = residual_effect(Coupled(done.generator, gentle.period, done.groups))
        assert (np.diagonal(other) <= 2 * np.diagonal(bounds[0]) + 1e-14).all()


def nodding(t):
    """diag(-1, -900) turned to and fro."""
    angle, rate = np.sin(2 * np.pi * t), 2 * np.pi * np.cos(2 * np.pi * t)
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]]).transpose(2, 0, 1)
    return R @ np.diag([-1.0, -900]) @ np.swapaxes(R, 1, 2) + rate[:, None, None] * np.array([[0.0, -1], [1, 0]])


def waving(harmonic, fast=900.0):
    return lambda t: np.diag([-1.0, -fast]) * (1 + 0.01 * np.cos(2 * np.pi * harmonic * t))[:, None, None]


@pytest.mark.parametrize(
    ("A", "words"),
    [
        (lambda t: waving(1, 3.0)(t), "stand apart"),
        (nodding, "mixes"),
        (waving(70), "harmonics"),
        (
            lambda t: np.array([[-500.0, 1, 0], [0, -500, 0], [0, 0, -1]]) * (1 + 0.01 * waving(1)(t)[:, :1, :1]),
            "depend|coincide|tol",
        ),
        (lambda t: np.diag([-1.0, -500]) * (1 + 0.1 * (t[:, None, None] > 0.4002)), "Fourier"),
        (lambda t: np.diag([-1.0, -500]) * (1 + 0.1 * np.abs(t[:, None, None] - 0.4)), "Fourier"),
    ],
    ids=["slow", "nodding modes", "many harmonics", "defective", "jump", "corner"],
)
def test_what_it_does_not_serve(A, words):
    refusal = solve_at_once(fl.PeriodicSystem(A, 1.0), 1e-9)
    assert isinstance(refusal, Refusal)
    assert any(word in refusal.reason for word in words.split("|")), refusal.reason
    assert "keep their shapes" not in str(fl.floquet(fl.PeriodicSystem(A, 1.0)).setting)


def test_modes_of_a_loop_with_integral_action_are_not_followed_together(monkeypatch):
    """-4.3 +- 2.5j and -1.1 +- 13.5j stand close for a motion of 3.1 1/s, and part by exp(6.4) over its period."""
    rng, mean = np.random.default_rng(4), np.diag([-4.3, -4.3, -1.1, -1.1, -1.6, -1.6, -500.0])
    for i, frequency in zip((0, 2, 4), (2.5, 13.5, 95.0), strict=True):
        mean[i, i + 1], mean[i + 1, i] = frequency, -frequency
    V, C, S = np.linalg.qr(rng.standard_normal((7, 7)))[0], *rng.standard_normal((2, 7, 7))

    def A(t):
        c, s = (f(np.pi * t)[:, None, None] for f in (np.cos, np.sin))
        return V @ (mean + 0.05 * c * C + 0.05 * s * S) @ V.T

    def make():
        return fl.PeriodicSystem(A, 2.0)

    exact = fl.floquet(make(), 1e-12, method="gauss")
    for exponents, errors, *_ in solved(make, 1e-9, monkeypatch):
        partner, apart = match_logs(exact.log_multipliers, exponents * 2.0)
        assert np.all(apart / 2.0 <= errors[partner] + exact.errors)


def test_a_tolerance_that_rounding_forbids_is_refused():
    gentle = next(g for g in map(gentle_system, range(20)) if g.n > 4)
    assert isinstance(solve_at_once(as_system(gentle), 1e-16), Refusal)


def test_a_first_look_at_eight_times_hides_nothing():
    """What vanishes at all eight nodes of the first look is found by the nodes that follow."""

    def bump(t):
        return np.diag([-1.0, -500]) + 400 * np.sin(8 * np.pi * t)[:, None, None] ** 2 * np.eye(2)[::-1]

    decoupled = decouple_steady(bump, 1.0, 8)
    assert isinstance(decoupled, Refusal)
