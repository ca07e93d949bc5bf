"""Fast modes that rounding hides, that hide behind others, take turns, or stand close for the motion: known exponents, and segments."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic import as_real, decouple, decoupled_exponents
from tests.closed_arm import closed
from tests.periodic.chains import Wave
from tests.periodic.judge import covers
from tests.periodic.rotated import Rotated, gentle_system, mix

T = 2.0


def wave(mean, share=0.0):
    return Wave(mean, 0, (mean * share,), (0.0,))


def test_what_rounding_hides_is_stated():
    """Two modes that take turns in damping by exp(25): nobody can make their exponents surer, and the slow ones stand."""
    modes = [(wave(-1.0), wave(2.0)), (wave(-90.0, 0.35), wave(9e3, 0.01)), (wave(-90.0, -0.35), wave(3e4))]
    system = Rotated(T, modes, mix(np.random.default_rng(0), 6, -2.5, -2.0))
    found = fl.floquet(fl.PeriodicSystem(system, T), 1e-9, max_segments=100)
    assert (found.setting.method, found.verdict) == ("decoupling", "stable")
    assert found.errors[:2].max() < 1e-9
    assert found.errors[2:].min() > 1e-6
    assert covers(found, system.exponents, T)


def test_leading_modes_that_are_hidden_are_enclosed():
    gentle = gentle_system(10)
    assert fl.floquet(fl.PeriodicSystem(gentle, gentle.period, complete=True), 1e-4).error < 10


def test_nothing_hides_between_eight_times():
    """What vanishes at all eighths of the period is seen."""

    def bump(t):
        return np.diag([-1.0, -500]) + 400 * np.sin(8 * np.pi * t)[:, None, None] ** 2 * np.eye(2)[::-1]

    one, other = fl.floquet(fl.PeriodicSystem(bump, 1.0)), fl.floquet(fl.PeriodicSystem(bump, 1.0), method="gauss")
    assert covers(one, other.exponents, 1.0, other.errors)


def loop_with_integral_action():
    """-4.3 +- 2.5j and -1.1 +- 13.5j stand close for a motion of 3.1 1/s, and part by exp(6.4) over its period."""
    rng, mean = np.random.default_rng(4), np.diag([-4.3, -4.3, -1.1, -1.1, -1.6, -1.6, -500.0])
    for i, frequency in zip((0, 2, 4), (2.5, 13.5, 95.0), strict=True):
        mean[i, i + 1], mean[i + 1, i] = frequency, -frequency
    V, C, S = np.linalg.qr(rng.standard_normal((7, 7)))[0], *rng.standard_normal((2, 7, 7))

    def A(t):
        c, s = (f(np.pi * t)[:, None, None] for f in (np.cos, np.sin))
        return V @ (mean + 0.05 * c * C + 0.05 * s * S) @ V.T

    return A


NEAR_RESONANCE = {
    "links.0.length": 1.4514989414327564,
    "links.0.bending_stiffness": 5.76348022851932,
    "effects.payload.mass": 0.009204494307271176,
    "effects.modal_damping.ratio": 0.04466805189756285,
    "motion.frequency": 0.7286070043858148,
    "motion.joints": [{"mean": -0.4095314886746084, "amplitude": 0.9911682460300291}],
    "links.0.modes": 1,
}
"""-11.8 +- 3.2 i in units of the basic frequency, in resonance with the sixth harmonic."""
HARD_DRIVE = {
    "links.0.bending_stiffness": 12.388797456853958,
    "motion.frequency": 1.0400200303386022,
    "motion.joints": [{"mean": 0.7813837525671954, "amplitude": 1.9389085670418087}],
    "effects.payload.mass": 0.021919559665140278,
    "effects.modal_damping.ratio": 0.004038122123472825,
    "control.feedback": {"kind": "pd", "kp": [7.684278843470476], "kd": [1.5899715647696537]},
    "links.0.modes": 3,
}
"""Eigenvectors of the mean, in metres and metres per second, of a joint mode that decays within a millisecond: their inverse needs care."""


@pytest.mark.parametrize("changes", [None, NEAR_RESONANCE, HARD_DRIVE], ids=["integral", "resonance", "hard drive"])
def test_segments_give_the_same_exponents(changes):
    system = closed(changes=changes).periodic_system() if changes else fl.PeriodicSystem(loop_with_integral_action(), T)
    exact, found = fl.floquet(system, 1e-10, method="gauss"), [fl.floquet(system, 1e-8)]
    decoupled = decouple(system.resolved, system.period, tol=1e-8)
    found += [] if decoupled is None else [decoupled_exponents(decoupled, 1e-8)]
    assert all(covers(one, exact.exponents, system.period, exact.errors) for one in found)


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
    """Modes take turns in being damped less: which one a multiplier follows cannot be seen, and may not be claimed.

    w'' = q(t) w with q a polynomial in exp(i t): only one sign of harmonics, so the exponents are +-sqrt(q_0) exactly, whatever the
    eigenvalues +-sqrt(q(t)) do on the way (Berry, Uzdin, J. Phys. A 44 (2011), 435303). Where roots of q lie inside the unit circle,
    their means are others.
    """
    A, exponents = cycling(rate, roots)
    decoupled = decouple(A, 2 * np.pi, tol=1e-8)
    if decoupled is None:
        return
    answer = decoupled_exponents(decoupled)
    assert covers(answer, exponents, 2 * np.pi)
    assert (answer.exponents.real + answer.errors < 0).all()  # enclosed well enough for a verdict
