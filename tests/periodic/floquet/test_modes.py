"""Modes of segments and of decoupled systems, their derivatives and resonances, and frozen modes."""

import numpy as np
import pytest
from scipy.linalg import block_diag

import flexlin as fl
from flexlin import floquet_modes
from flexlin.errors import ArgumentError
from flexlin.periodic import (
    decouple,
    decoupled_exponents,
    differentiate_exponents,
    find_resonances,
    follow_frozen_modes,
    gauss_transitions,
    solve_decoupled_modes,
    solve_modes_at_nodes,
    stack_companion,
)
from tests.periodic.chains import Rotation, Wave
from tests.periodic.rotated import Rotated, gentle_system
from tests.periodic.systems import colaneri, lyapunov_transformed, mathieu, meissner


def mathieu_system(a, q):
    return fl.PeriodicSystem(mathieu(a, q), np.pi)


D = block_diag([[0.3, 2.0], [-2.0, 0.3]], [[-1.5]])
TRANSFORMED = fl.PeriodicSystem(lyapunov_transformed(D, 3.0, 2, np.random.default_rng(4)), 2 * np.pi / 3)
FAR = fl.PeriodicSystem(colaneri, 2 * np.pi)
JUMPING = fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,))
HALF_TURN = fl.PeriodicSystem(
    lyapunov_transformed(np.array([[-0.7, -0.5], [0.5, -0.7]]), 1.0, 2, np.random.default_rng(7)), 2 * np.pi
)
"""Its multipliers coincide and are negative."""
CHAIN = fl.PeriodicSystem(lambda t: np.multiply.outer(np.cos(t) - 2, [[1.0, -1.0], [0.0, 1.0]]), 2 * np.pi)
"""Of two equal multipliers, with one mode."""
SWELLING = fl.PeriodicSystem(lambda t: np.stack([[[-0.1, 1], [1, -15 - 20 * np.cos(s)]] for s in t]), 2 * np.pi)


@pytest.mark.parametrize("system", [TRANSFORMED, FAR, mathieu_system(1, 0.2), JUMPING, HALF_TURN, CHAIN, SWELLING])
def test_modes_solve_the_equations_and_are_biorthogonal(system):
    modes = floquet_modes(system)
    grid = np.append(modes.times, system.period)
    Phi = gauss_transitions(system.A, grid, 8)
    shrink = np.exp(-modes.exponents * np.diff(grid)[:, None])[:, None, :]
    np.testing.assert_allclose(np.abs(modes.right).max(axis=(0, 1)), 1, rtol=0.9)
    np.testing.assert_allclose(np.roll(modes.right, -1, axis=0), shrink * (Phi @ modes.right), atol=1e-9)
    gram = np.einsum("tki,tkj->tij", modes.left.conj(), modes.right)
    scale = np.linalg.norm(modes.left, axis=1)[:, :, None] * np.linalg.norm(modes.right, axis=1)[:, None, :]
    assert (np.abs(gram - np.eye(system.n)) / np.maximum(scale, 1)).max() < 1e-11
    assert abs(modes.weights.sum() - 1) < 1e-13
    np.testing.assert_allclose(modes.participation.sum(axis=0), 1)


def test_participation_of_uncoupled_states():
    system = fl.PeriodicSystem(lambda t: np.stack([np.diag([-1 + np.cos(s), -3.0]) for s in t]), 2 * np.pi)
    np.testing.assert_allclose(floquet_modes(system).participation, np.eye(2), atol=1e-12)


def test_derivatives_against_exact_ones_of_a_transformed_system():
    """A + theta I moves every exponent by theta."""
    modes = floquet_modes(TRANSFORMED, tol=1e-11)
    shift = np.broadcast_to(np.eye(3), (len(modes.times), 3, 3))
    np.testing.assert_allclose(differentiate_exponents(modes, shift), 1, atol=1e-9)
    # time and A scaled together, A(t) -> (1 + theta) A((1 + theta) t): lambda -> (1 + theta) lambda, T -> T / (1 + theta)
    A = TRANSFORMED.A(modes.times)
    unfolded = differentiate_exponents(modes, A, A, period_slope=-TRANSFORMED.period)
    np.testing.assert_allclose(unfolded, modes.exponents, atol=1e-9)


def test_derivatives_of_mathieu_against_differences():
    """d lambda / dq inside the first tongue, against a central difference of independent solutions."""
    modes, h = floquet_modes(mathieu_system(1, 0.2), tol=1e-12), 1e-4
    slope = np.zeros((2, len(modes.times), 2, 2))
    slope[0, :, 1, 0] = 2 * np.cos(2 * modes.times)
    slope[1, :, 1, 0] = -1

    def growth(a, q):
        return fl.floquet(mathieu_system(a, q), tol=1e-12).exponents[0].real

    changes = [growth(1, 0.2 + h) - growth(1, 0.2 - h), growth(1 + h, 0.2) - growth(1 - h, 0.2)]
    np.testing.assert_allclose(differentiate_exponents(modes, slope)[:, 0].real, np.array(changes) / (2 * h), atol=1e-6)
    with pytest.raises(ArgumentError, match="shape"):
        differentiate_exponents(modes, slope[:, :-1])
    with pytest.raises(ArgumentError, match="missing"):
        differentiate_exponents(modes, slope, period_slope=1.0)


@pytest.mark.parametrize(
    ("frequency", "coupling", "kind", "order", "pair"),
    [
        (6.0, [[2.0, 0], [0, 0]], "principal", 1, (3, 3)),
        (10.0, [[0, 0], [0, 4.0]], "principal", 1, (5, 5)),
        (3.0, [[6.0, 0], [0, 0]], "principal", 2, (3, 3)),
        (8.0, [[0, 2.0], [2.0, 0]], "sum", 1, (5, 3)),
        (2.0, [[0, 2.0], [-2.0, 0]], "difference", 1, (5, 3)),
    ],
)
def test_resonances_are_named(frequency, coupling, kind, order, pair):
    """Of oscillators of 3 and 5 rad/s with stiffness coupling * cos(w t).

    Symmetric coupling gives sum resonances, skew coupling difference resonances (Nayfeh, Mook 1979, section 5.3).
    """

    def stiffness(t):
        return np.diag([9.0, 25.0]) + np.cos(frequency * t)[:, None, None] * np.array(coupling)

    system = fl.PeriodicSystem.from_second_order(np.eye(2), 0.01 * np.eye(2), stiffness, 2 * np.pi / frequency)
    found = find_resonances(system, floquet_modes(system))
    assert found
    for resonance in found:
        assert (resonance.kind, resonance.order) == (kind, order)
        np.testing.assert_allclose(resonance.frequencies, pair, atol=1e-3)
        assert resonance.detuning < 1e-2
        assert "order" in str(resonance)


def test_a_wide_tongue_is_entered_far_from_its_condition_and_no_frequency_is_called_near():
    """Mathieu's first tongue at a = 0.6, q = 0.6: 2 x 0.775 rad/s is 23 % below 2 rad/s."""
    system = mathieu_system(0.6, 0.6)
    (found,) = find_resonances(system, floquet_modes(system))
    assert found.condition == "2 x 0.7746 rad/s at 0.45 rad/s from 1 w, w = 2 rad/s = 2 pi / T"


def test_an_unstable_average_is_no_resonance():
    A = np.array([[0, 1.0], [-4.0, 0.1]])
    system = fl.PeriodicSystem(A, 1.0)
    (found,) = find_resonances(system, floquet_modes(system))
    assert found.kind == "average"
    assert "by no resonance with the motion" in str(found)
    half, alone = fl.PeriodicSystem(A, np.pi / found.exponent.imag), fl.PeriodicSystem([[0.1]], 1.0)
    assert "flutter" in str(find_resonances(half, floquet_modes(half))[0])  # it turns by w / 2 by chance
    assert str(*find_resonances(alone, floquet_modes(alone))).endswith(": divergence, by no resonance with the motion")


@pytest.mark.parametrize(
    "D", [-np.eye(1), -np.eye(3), np.diag([-1.0, -1.0, -2.0])], ids=["one", "all alike", "two alike"]
)
def test_modes_of_one_state_and_of_coinciding_exponents_have_errors(D):
    """Each has a real mode of its own: of two alike, a Schur form finds conjugates."""
    system = fl.PeriodicSystem(lyapunov_transformed(D, np.pi, 2, np.random.default_rng(7)), 2.0)
    modes = fl.floquet_modes(system)
    product = np.einsum("tki,tkj->tij", modes.left.conj(), modes.right)
    assert np.abs(product - np.eye(len(D))).max() < 1e-11
    assert np.abs(modes.right.imag).max() < 1e-11
    assert modes.errors.max() < 1e-10


T = np.linspace(0.0, 1.0, 129)
"""Times at which frozen modes are followed by their shape: through crossings, along avoided ones, and into and out of rest."""
RNG = np.random.default_rng(7)


def state_matrices(K, D=0.0):
    """A(t) of y'' + D y' + K(t) y = 0."""
    n = K.shape[-1]
    return stack_companion(-K, np.broadcast_to(-D * np.eye(n), K.shape))


def lines(A):
    """The frequencies of the modes that oscillate somewhere, (N, k)."""
    found = follow_frozen_modes(A).frequencies
    return found[:, np.isfinite(found).any(axis=0)]


def test_modes_that_cross_go_straight_on_in_any_units():
    own = np.array([3.0 + 2 * T, 5.0 - 2 * T, 4.0 + 0 * T]).T  # all three meet at t = 1/2
    turn = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    K = np.einsum("ij,tj,kj->tik", turn, own**2, turn)
    units = (np.eye(6) + 0.3 * RNG.standard_normal((6, 6))) * 10.0 ** RNG.uniform(-2, 2, 6)
    for S in (np.eye(6), units):
        found = 2 * np.pi * lines(S @ state_matrices(K, 0.01) @ np.linalg.inv(S))
        assert found.shape == (129, 3)
        places = np.argsort(found[0])
        np.testing.assert_allclose(found[:, places], own[:, [0, 2, 1]], atol=1e-4)


def test_modes_that_turn_into_each_other_keep_their_order():
    a, b = 3.0 + 2 * T, 5.0 - 2 * T
    K = np.moveaxis(np.array([[a**2, 1.0 + 0 * T], [1.0 + 0 * T, b**2]]), -1, 0)
    found = np.sort(2 * np.pi * lines(state_matrices(K)), axis=1)
    np.testing.assert_allclose(2 * np.pi * lines(state_matrices(K)), found[:, np.argsort(np.argsort(found[0]))])
    np.testing.assert_allclose(found**2, np.linalg.eigvalsh(K), rtol=1e-9)


def test_a_mode_that_does_not_oscillate_has_no_frequency():
    """A pendulum that is turned over: it hangs for half of the time, and falls in the other half."""
    K = np.stack([np.diag([9.81 * np.cos(2 * np.pi * t), 400.0]) for t in T])
    found = follow_frozen_modes(state_matrices(K)).frequencies
    hanging = K[:, 0, 0] > 0
    assert (np.isfinite(found).sum(axis=1) == 1 + hanging).all()
    swing = np.sqrt(9.81 * np.cos(2 * np.pi * T[hanging])) / (2 * np.pi)
    np.testing.assert_allclose(np.nanmin(found[hanging], axis=1), swing)


def test_defective_matrices_are_followed():
    free = np.tile(np.eye(2, k=1), (5, 1, 1))  # a free body: its eigenvectors coincide
    assert np.isnan(follow_frozen_modes(free).frequencies).all()


def miss(vectors, A, exponents, period):
    """How far vectors p(t) (N, n, n) of any fast growth are from p' = A p - lambda p, by p = c(t) f(t) with u^H f = 1.

    f' = A f - m f, m = u^H (A f - f');   mean m = lambda modulo i w;   c' / c = m - lambda
    """
    k = 2j * np.pi * np.fft.fftfreq(len(vectors), period / len(vectors))[:, None]
    missed, size = [], np.linalg.norm(A, axis=(1, 2)).max()
    for i, exponent in enumerate(exponents):
        p = vectors[:, :, i] / np.linalg.norm(vectors[:, :, i], axis=1)[:, None]
        u = p[np.abs(p @ p.conj().T).min(axis=0).argmax()]  # whose product with p vanishes least
        f = p / (p @ u.conj())[:, None]
        rest = np.einsum("tij,tj->ti", A, f) - np.fft.ifft(k * np.fft.fft(f, axis=0), axis=0)
        m = rest @ u.conj()
        apart = (m.mean() - exponent) * period
        apart = np.hypot(apart.real, np.angle(np.exp(1j * apart.imag))) / (size * period)
        moved, inside = np.fft.fft(m - m.mean())[:, None], k != 0
        run = np.fft.ifft(np.where(inside, moved / np.where(inside, k, 1), 0), axis=0)[:, 0].real
        grown = np.log(np.abs(vectors[:, :, i] @ u.conj())) - run
        off = np.abs(rest - m[:, None] * f).max() / size / np.abs(f).max()
        by_shape = max(off, apart, np.ptp(grown) / (1 + np.ptp(run)))
        p = vectors[:, :, i] / np.abs(vectors[:, :, i]).max()  # serves where every u^H p vanishes at some time
        slope = np.fft.ifft(k * np.fft.fft(p, axis=0), axis=0)
        missed.append(min(by_shape, np.abs(slope + exponent * p - np.einsum("tij,tj->ti", A, p)).max() / size))
    return np.array(missed)


@pytest.mark.slow
@pytest.mark.parametrize("near_resonance", [False, True])
def test_columns_of_the_frame_solve_the_equation_and_its_adjoint(near_resonance):
    served = 0
    for seed in range(46, 62):
        case = gentle_system(seed, near_resonance)
        done = decouple(case, case.period)
        found = None if done is None else decoupled_exponents(done)
        modes = found and solve_decoupled_modes(done, found.exponents)
        if modes is None:
            continue
        served += 1
        (right, left), A = modes, case(done.times)
        assert miss(right, A, found.exponents, case.period).max() < 1e-8, seed
        assert miss(left, -np.swapaxes(A, 1, 2), -found.exponents.conj(), case.period).max() < 1e-8, seed
        gram = np.abs(np.einsum("tki,tkj->tij", left.conj(), right) - np.eye(case.n))
        size = np.linalg.norm(left, axis=1)[:, :, None] * np.linalg.norm(right, axis=1)[:, None]
        assert (gram / np.maximum(1, size)).max() < 1e-12
    assert served >= 2


def test_modes_of_a_slow_motion_are_right_or_called_unknown():
    """Few segments of a long period cannot follow the fast modes: once they ended in an overflow, or in wrong modes with small errors.

    A fast decay, a fast oscillation and a slow one, mixed by a turn of the first state into the last.
    """
    fast = [(Wave(-2600.0), None), (Wave(-1.0), Wave(100.0)), (Wave(-0.2), Wave(1.9))]
    A = Rotated(25.0, fast, [Rotation(0, 4, Wave(0.0, 0, (0.0,), (0.3,)))])
    system = fl.PeriodicSystem(A, 25.0, complete=True)
    found = fl.floquet(system)
    modes = fl.floquet_modes(system, found)
    assert np.isfinite(modes.errors).all()
    change = np.einsum("t,tki,tkl,tli->i", modes.weights, modes.left.conj(), A(modes.times), modes.right)
    assert np.abs(change.real - found.exponents.real).max() < 1e-5 * 2600
    # exponents of (1 + e) A for a turn that stays: those of (1 + e) D, to first order in 1 / period
    np.testing.assert_allclose(np.unique(np.abs(change.imag).round(3))[1:], [1.9, 100.0], atol=2e-3)
    few = solve_modes_at_nodes(system, found)
    assert np.isinf(few.errors[found.exponents.real < -100]).all()
    kept = np.isfinite(few.errors)
    again = np.einsum("t,tki,tkl,tli->i", few.weights, few.left.conj(), A(few.times), few.right)
    assert np.abs(again - change)[kept].max(initial=0.0) < 1e-3 * 100


@pytest.mark.parametrize("apart", [0.0, 1e-9])
@pytest.mark.parametrize("coupling", [0.0, 1.0])
def test_modes_that_coincide_are_right_or_left_to_others(apart, coupling):
    """Two slow oscillators alike, or a Jordan chain of them, beside a fast decay: no column is taken twice, and nothing is singular."""
    slow = np.array([[-0.1, 2.0], [-2.0, -0.1]])
    D = block_diag(-60.0, slow, slow - apart * np.eye(2)) + np.diag([0.0, coupling, coupling], 2)

    def A(t):
        return (1 + 0.1 * np.cos(t))[:, None, None] * D

    decoupled = decouple(A, 2 * np.pi)
    assert sorted(group.size for group in decoupled.groups) == [1, 4]
    exponents = decoupled_exponents(decoupled).exponents
    modes = solve_decoupled_modes(decoupled, exponents)
    if modes is None:
        assert coupling or not apart  # what is neither coupled nor alike is solved
    else:
        assert miss(modes[0], A(decoupled.times), exponents, 2 * np.pi).max() < 1e-12
