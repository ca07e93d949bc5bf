"""Hill's matrix, and identities that exponents by every method must satisfy, on random periodic systems."""

import numpy as np
import pytest
from scipy.special import mathieu_a

import flexlin as fl
from flexlin.checks import memory_limit
from flexlin.errors import TooManySegments
from flexlin.periodic import METHODS, hill_spectrum
from tests.periodic.judge import covers
from tests.periodic.systems import mathieu, meissner, oscillator, random_waves
from tests.thinned import thin


def test_copies_of_double_exponents_are_told_from_solutions():
    """Two equal, uncoupled Mathieu equations: each exponent twice, none missed, none taken as its own shifted copy."""

    def twice(t):
        A = mathieu(1, 0.2)(t)
        return np.block([[A, np.zeros_like(A)], [np.zeros_like(A), A]])

    spectrum = hill_spectrum(fl.PeriodicSystem(twice, np.pi), 1e-9)
    growth = np.repeat([-1, 1], 2) * 0.099536437275513447
    np.testing.assert_allclose(np.sort(spectrum.exponents.real), growth, atol=1e-12)


def fast_pendulum(waves, swing=300.0, stiffness=-1.0):
    """y'' + 0.1 y' + (stiffness - swing cos 2 pi waves t) y = 0, T = 1."""
    return fl.PeriodicSystem(lambda t: oscillator(stiffness - swing * np.cos(2 * np.pi * waves * t), 0.1), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("waves", [7, 40])
def test_waves_beyond_the_first_harmonics_are_not_left_out(waves):
    """Kapitza's pendulum stands because its support shakes: truncations without that wave agree with each other that it falls."""
    system = fast_pendulum(waves, swing=2.5 * waves * 2 * np.pi)
    hill, transition = fl.floquet(system, method="hill"), fl.floquet(system)
    assert hill.verdict == transition.verdict == "stable"
    assert covers(hill, transition.exponents, 1.0, transition.errors)
    assert hill.error < 1e-7


@pytest.mark.parametrize("order", [1, 2, 3, 12])
def test_harmonics_that_are_held_say_by_how_much_they_err(order):
    system = fl.PeriodicSystem(mathieu(1, 1.5), np.pi) if order < 12 else fast_pendulum(40)
    hill, best = fl.floquet(system, method="hill", order=np.int64(order)), fl.floquet(system, 1e-11)
    assert hill.setting.order == order
    assert covers(hill, best.exponents, system.period, best.errors)
    assert not covers(hill, best.exponents, system.period, best.errors, factor=1e-8 / hill.error)
    assert "rounding" not in hill.status


def test_what_is_not_known_of_the_series_is_part_of_the_error():
    """Fast waves: A is known to 1e-13 of 50, far above the rounding of Hill's matrix."""
    system = fast_pendulum(20, 50.0, 1.0)
    hill, best = fl.floquet(system, method="hill"), fl.floquet(system, 1e-13)
    assert covers(hill, best.exponents, 1.0, best.errors)


def test_boundary_and_jumps_show_in_the_error():
    boundary = fl.floquet(fl.PeriodicSystem(mathieu(mathieu_a(2, 0.8), 0.8), np.pi), method="hill")
    assert boundary.verdict == "undecided"
    assert np.abs(boundary.exponents).max() <= boundary.error
    jump = fl.floquet(fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)), method="hill", order=32)
    assert abs(jump.exponents[0].real - 0.04137974466122074514) <= jump.error < 1e-5


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
