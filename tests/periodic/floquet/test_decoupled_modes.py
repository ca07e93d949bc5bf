import numpy as np
import pytest
from scipy.linalg import block_diag

import flexlin as fl
from flexlin.periodic import decouple, decoupled_exponents, solve_decoupled_modes, solve_modes_at_nodes
from tests.periodic.chains import Rotation, Wave
from tests.periodic.rotated import Rotated, gentle_system


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
