import re

import numpy as np
import pytest
from scipy.linalg import block_diag, expm
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin.errors import NumericalError
from flexlin.periodic import Setting, judge
from flexlin.periodic.floquet.exponents import is_hamiltonian
from tests.periodic.judge import covers
from tests.periodic.systems import colaneri, mathieu, mathieu_second_order
from tests.periodic.truths import apart, eigenvalues


@pytest.mark.parametrize(("characteristic", "side"), [(mathieu_a, -1), (mathieu_b, +1)])
@pytest.mark.parametrize("index", [1, 2, 3])
def test_verdicts_on_both_sides_of_a_tongue(characteristic, side, index):
    """Between b_k and a_k the solution grows (q > 0): just inside it is unstable, on the boundary undecided."""
    q, boundary = 0.8, float(characteristic(index, 0.8))
    assert fl.floquet(mathieu_second_order(boundary + side * 1e-5, q)).verdict == "unstable"
    assert fl.floquet(mathieu_second_order(boundary - side * 1e-5, q)).verdict == "undecided"
    assert fl.floquet(mathieu_second_order(boundary, q)).verdict == "undecided"


def test_a_fixed_resolution_is_not_called_the_least_work_nor_rounding():
    system = fl.PeriodicSystem(mathieu(1, 1.5), np.pi)
    result, best = fl.floquet(system, method="gauss", order=4, segments=1), fl.floquet(system)
    assert covers(result, best.exponents, np.pi)
    assert best.verdict == "unstable"
    assert (result.verdict, result.reason) == ("undecided", "the resolution is too coarse to decide")
    assert "on 1 segment (as asked" in result.status
    assert "rounding" not in result.status
    assert "was not reached" in result.status
    assert "leave method, order and segments to the solver" in result.status


@pytest.mark.parametrize("growth", [300.0, 650.0, -650.0, 900.0])
@pytest.mark.parametrize("n", [1, 2])
def test_modes_that_all_grow_or_decay_alike(n, growth):
    """Their products are well conditioned and yet leave the range of floating-point numbers; the exponent is the mean, exactly."""

    turn = np.triu(np.ones((n, n)), 1) - np.tril(np.ones((n, n)), -1)

    def A(t):
        return growth * (1 + 0.5 * np.sin(2 * np.pi * t))[:, None, None] * np.eye(n) + turn

    result = fl.floquet(fl.PeriodicSystem(A, 1.0))
    assert result.verdict == ("unstable" if growth > 0 else "stable")
    assert np.all(np.abs(result.exponents.real - growth) <= result.errors)
    assert np.all(result.errors < 1e-6)
    assert growth < 900 or np.isinf(result.multipliers).all()


def test_stages_that_are_exactly_singular_are_refused():
    """x' = 2 x over one segment of 1 s: one stage, 1 - h a / 2 = 0, in any arithmetic."""
    system = fl.PeriodicSystem(lambda t: np.full((len(t), 1, 1), 2.0) + 0.0 * np.cos(2 * np.pi * t)[:, None, None], 1.0)
    with pytest.raises(NumericalError, match="ask for more segments"):
        fl.floquet(system, method="gauss", order=2, segments=1)


@pytest.mark.parametrize("damping", [0.0, 1e-22, 1e-18, 1e-14])
def test_a_free_motion_is_known_although_rounding_parts_its_double_exponent(damping):
    """A slide with a mast that bends: 0 twice, whose eigenvectors are alike; with vectors of their own errors would be 1000 1/s."""
    M, K = [[2.7, -0.8, 0.17], [-0.8, 1.33, -0.8], [0.17, -0.8, 1.33]], np.diag([0.0, 1.2e4, 4.6e5])
    result = fl.floquet(fl.PeriodicSystem.from_second_order(M, np.diag([damping, 0.79, 4.9]), K, 1.0))
    assert result.verdict == "undecided"
    assert np.abs(result.exponents[:2]).max() <= result.error < 1e-5


@pytest.mark.parametrize("gap", [1e-12, 1e-9, 1e-7])
def test_a_nearly_double_exponent_is_stated_to_the_root_of_rounding(gap):
    """Two eigenvalues that are coupled are bounded as a pair; a third one near them moves by what couples the pair, too."""
    rng = np.random.default_rng(5)
    for near in (1.0, 1e-2, 1e-4):
        A = np.array([[-1.0, 1.0, 1.0], [0.0, -1.0 - gap, 1.0], [0.0, 0.0, -1.0 - near]])
        Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        for form in (A, A[::-1, ::-1].T):
            M = Q @ form @ Q.T
            result = fl.floquet(fl.PeriodicSystem(M, 1.0))
            assert covers(result, eigenvalues(M), 1.0)
            assert result.error < 1e-6 / near


@pytest.mark.parametrize("seed", range(4))
def test_modes_of_which_nothing_is_left_ask_for_no_segments(seed):
    """Damped modes of 4e4 1/s and 600 +- 4000j 1/s between jumps: to follow them took 4e4 segments: beyond the limit, said after 14 s."""
    rng, T = np.random.default_rng(seed), 6.0
    fast = block_diag([[-600.0, 4000.0], [-4000.0, -600.0]], [[-4e4]])
    slow = ([[0.0, 1.0], [-k, -0.1]] for k in (4.0, 7.0))
    halves = np.array([block_diag(one, fast) + 0.3 * rng.standard_normal((5, 5)) for one in slow])
    found = fl.floquet(fl.PeriodicSystem(lambda t: halves[(t % T >= T / 2).astype(int)], T, breaks=(T / 2,)))
    exact = np.log(np.linalg.eigvals(expm(halves[1] * T / 2) @ expm(halves[0] * T / 2)).astype(complex)) / T
    missed = np.abs(found.exponents[:2].real - np.sort(exact.real)[[-1, -2]])
    assert np.all(missed <= found.errors[:2] + 1e-11)
    assert found.error < 1e-8
    assert found.setting.segments < 2000
    assert np.isinf(found.errors[2:]).all()
    assert "too fast" in found.status


@pytest.mark.parametrize(
    ("A", "verdict", "words"),
    [
        ([[0, 1.0], [-1.0, 0]], "undecided", "undamped"),
        ([[0, 1e6], [0, 0]], "undecided", "double precision cannot decide|zero to within"),
        (np.diag([-1e-11, -1.0]), "stable", "practically marginal"),
        (np.diag([-1.0, -2.0]), "stable", "^$"),
        (np.zeros((2, 2)), "undecided", "which rounding makes"),
        (lambda t: np.cos(2 * np.pi * t)[:, None, None], "undecided", "which rounding makes"),
    ],
)
def test_reasons_of_verdicts_that_say_less_than_they_seem(A, verdict, words):
    found = fl.floquet(fl.PeriodicSystem(A, 1.0))
    assert found.verdict == verdict
    assert re.search(words, found.reason)
    assert found.reason in found.status


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1.0, 1e160, 1e300])
def test_a_constant_system_of_any_size_keeps_its_relative_error(size):
    damped = np.array([[0.0, 1.0], [-1.0, -0.1]])
    found = fl.floquet(fl.PeriodicSystem(size * damped, 1e-3))
    assert found.verdict == "stable"
    assert found.exponents.real == pytest.approx([-0.05 * size] * 2, rel=1e-13)
    assert np.all(np.abs(found.exponents.real + 0.05 * size) <= found.errors)
    assert found.error < 1e-13 * size


def test_modes_that_radau_cannot_follow_are_not_said_to_decay_faster_than_those_it_can():
    """A fast mode that hardly decays, but faster than the slowest one: that it does is all that is known of it."""
    fast, slow = np.array([[-0.01, 3e3], [-3e3, -0.01]]), np.array([[-4.0, 0.3], [0.0, -1e-4]])
    A = block_diag(fast, slow)
    system = fl.PeriodicSystem(lambda t: A * (1 + 1e-3 * np.cos(t))[:, None, None], 2 * np.pi)
    result = fl.floquet(system, 1e-4, method="radau")
    bound = (result.exponents.real + result.errors)[np.isfinite(result.errors)].max()
    assert -0.01 < bound < 0
    assert np.isinf(result.errors).any()
    assert f"only known to lie below {bound:.3g} 1/s" in result.status


def test_no_verdict_without_a_single_known_exponent():
    """All errors were infinite here, and growth rates below zero were read as modes that decay too fast to be resolved."""
    none = judge(np.array([-1.0, -2.0]), np.full(2, np.inf), 1.0, Setting("gauss", 8, 4, ""), 1e-9)
    assert none.verdict == "undecided"


SPIN = np.array([[0, 0.6], [-0.6, 0]])


def waving(mean, wave, pattern):
    """mean + wave(t) times a pattern."""
    return lambda t: np.array(mean) + wave(t)[:, None, None] * np.array(pattern)


def spinning(damping):
    """Two coordinates whose mass and stiffness wave, under gyroscopic forces that keep the energy's balance, and damping."""
    M = waving(np.diag([2.0, 1.0]), np.sin, np.full((2, 2), 0.3))
    K = waving(np.diag([3.0, 7.0]), lambda t: np.cos(2 * t), [[0.4, 0.8], [0.8, 0.0]])
    D = waving(SPIN + damping * np.eye(2), np.cos, np.full((2, 2), 0.3))
    return fl.PeriodicSystem.from_second_order(M, D, K, 2 * np.pi)


@pytest.mark.parametrize(
    "system", [fl.PeriodicSystem(mathieu(2.2, 0.5), np.pi), mathieu_second_order(2.2, 0.5), spinning(0.0)]
)
def test_exponents_of_undamped_systems_are_paired_exactly(system):
    assert is_hamiltonian(system)
    result = fl.floquet(system)
    assert apart(result.exponents, -result.exponents, result.period).min(axis=1).max() < 1e-15
    assert result.verdict == "undecided"
    assert "bounded" in result.status


def test_only_what_is_damped_or_driven_is_not_taken_for_undamped():
    driven = fl.PeriodicSystem.from_second_order(waving(np.eye(2), np.sin, 0.3 * np.eye(2)), SPIN, np.eye(2), 2 * np.pi)
    others = driven, fl.PeriodicSystem(colaneri, 2 * np.pi), fl.PeriodicSystem(-np.eye(3), 1.0)
    assert not any(map(is_hamiltonian, (spinning(1e-4), *others)))
    half_spin = waving(5 * np.eye(2), np.cos, SPIN / 2)
    varying = fl.PeriodicSystem.from_second_order(np.eye(2), waving(0 * SPIN, np.sin, SPIN), half_spin, 2 * np.pi)
    assert is_hamiltonian(varying)
    assert fl.floquet(spinning(1e-4)).verdict == "stable"
