"""Norms of periodic systems: rotated constant systems, whose norms are those of the constant one; of random ones in coordinates that turn
the truth is a sum over modes, maximised on ever finer grids."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import ortho_group

import flexlin as fl
from tests.periodic.systems import turned
from tests.thinned import thin


def residues(A, B, C):
    """Poles (n,) of C (s - A)^-1 B and their residues (n, p, m)."""
    poles, V = np.linalg.eig(A)
    return poles, np.einsum("pk,km->kpm", C @ V, np.linalg.solve(V, B + 0j))


def largest_gain(A, B, C):
    """The largest singular value of C (i w - A)^-1 B over w, about every resonance and on ever finer grids."""
    poles, parts = residues(A, B, C)

    def gains(w):
        return np.linalg.norm(np.einsum("wk,kpm->wpm", 1 / (1j * w[:, None] - poles), parts), 2, axis=(1, 2))

    beside = np.geomspace(1e-3, 1e3, 400)
    near = np.concatenate([-beside, [0.0], beside])
    every = (pole.imag + pole.real * near for pole in poles)
    w = np.unique(np.abs(np.concatenate([[0.0], np.geomspace(1e-4, 1e3, 6000), *every])))
    found = gains(w)
    best = found.max()
    for k in np.argsort(found)[-12:]:
        low, high = w[max(k - 1, 0)], w[min(k + 1, len(w) - 1)]
        for _ in range(12):
            x = np.linspace(low, high, 33)
            y = gains(x)
            best, at = max(best, y.max()), int(y.argmax())
            low, high = x[max(at - 1, 0)], x[min(at + 1, 32)]
    return best


def energy(A, B, C):
    """The H2 norm of C (s - A)^-1 B, a sum over pairs of poles."""
    poles, parts = residues(A, B, C)
    return np.sqrt(np.einsum("ipm,jpm,ij->", parts, parts.conj(), -1 / np.add.outer(poles, poles.conj())).real)


def narrow_feedthrough(t):
    return (1 + 5 * np.exp(-(((t - 0.3017) / 2e-4) ** 2)))[:, None, None]


@pytest.mark.parametrize("tol", thin([1e-2, 1e-9, 1e-12]))
def test_a_norm_that_a_narrow_feedthrough_makes(tol):
    """Levels between the feedthrough's samples and its peak ended in a bare LinAlgError, or in doubts about A."""
    found = fl.hinf_norm(fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]]), [[1e-3]], narrow_feedthrough, tol=tol)
    assert abs(found.value - 6.0) <= found.error <= max(tol, 2e-9) * found.value


@pytest.mark.parametrize("period", [0.3, 1.0])
def test_a_gain_that_is_alike_at_all_frequencies(period):
    """(s - 1) / (s + 1): errors that say nothing at the first level led to one 10 % above."""
    found = fl.hinf_norm(fl.PeriodicSystem([[-1.0]], period, B=[[1.0]]), [[-2.0]], [[1.0]])
    assert abs(found.value - 1.0) <= found.error <= 1e-5
    pulse, late = (lambda t, lag=lag: np.exp(5 * np.cos(t - lag) - 5)[:, None, None] for lag in (0.0, 1.0))
    found = fl.hinf_norm(fl.PeriodicSystem([[-5.0]], 2 * np.pi, B=pulse), late)
    assert found.error <= 1e-8 * found.value


def test_a_level_just_above_the_norm_is_found_there():
    """Modes 1e-4 apart were taken for each other where they were known to 1e-3: the norm was missed by 2,500 times its error."""
    rng = np.random.default_rng(3)
    A = -np.diag(10 ** rng.uniform(-1.5, 0, 3))
    A[0, 1], A[1, 0] = -0.5, 30.0
    B, C = rng.normal(size=(3, 2)), rng.normal(size=(1, 3))
    found, known = fl.hinf_norm(*turned(A, B, C, 1.2566)), largest_gain(A, B, C)
    assert abs(found.value - known) <= found.error <= 1e-8 * known


@pytest.mark.parametrize("period", [0.05, 1.0, 7.0])
@pytest.mark.parametrize("c", [1e-2, 1e-4, 1e-6])
def test_no_norm_misses_by_more_than_its_error(c, period):
    """s / (s^2 + c s + 2), whose norm is 1 / c: where modes lie so near the circle that they cannot be told from their counterparts, the
    error says so."""
    system = fl.PeriodicSystem([[0.0, 1.0], [-2.0, -c]], period, B=[[0.0], [1.0]])
    found, turn = fl.hinf_norm(system, [[0.0, 1.0]]), 2 * np.pi / period
    assert abs(found.value - 1 / c) <= found.error + 1e-9 / c
    assert found.error < 1e-6 / c or c / 2 * period < 1e-4
    assert abs(found.frequency - min(2**0.5 % turn, -(2**0.5) % turn)) < 2e-3


def test_a_mode_that_turns_more_often_in_a_period_than_inputs_that_are_tried():
    """Of 80 turns; inputs of at most 48 missed its gain, and the bracket was four times as wide as the norm."""
    A = np.zeros((4, 4))
    A[:2, :2], A[2:, 2:] = [[0.0, 1.0], [-1.0, -0.2]], [[0.0, 80.0], [-80.0, -0.016]]
    B, C = np.array([[0.0, 1.0, 0.0, 1.0]]).T, np.array([[1.0, 0.0, 1.0, 0.0]])
    found, exact = fl.hinf_norm(*turned(A, B, C, speed=1.0)), largest_gain(A, B, C)
    assert abs(found.value - exact) <= found.error <= 1e-6 * exact


@pytest.mark.parametrize("through", [0.0, 2.0])
def test_a_mode_that_is_reached_beside_one_that_is_seen(through):
    """The gain is that of the feedthrough; rounding, of which levels were tried in vain for 20 s, is all that the modes add."""
    A, mix = np.array([[-1e-7, 0.3, 0.0], [-0.3, -1e-7, 0.0], [0.0, 0.0, -1.0]]), ortho_group(3, seed=1).rvs()
    B, C = mix @ np.array([[1.0], [2.0], [0.0]]), np.array([[0.0, 0.0, 3.0]]) @ mix.T
    found = fl.hinf_norm(*turned(mix @ A @ mix.T, B, C, speed=1.0), [[through]])
    assert abs(found.value - through) <= found.error <= 1e-3
    assert found.status.startswith("limited by rounding" if through else "rounding hides the norm: it is at most")


def test_a_feedthrough_that_no_gain_exceeds_is_the_norm_and_no_level_takes_back_a_better_one():
    C, D = [[0.37074787], [1.54134579], [0.64302531]], [[0.18114267], [-0.24217865], [-0.52908468]]
    found = fl.hinf_norm(fl.PeriodicSystem([[-19.25308691]], 0.0846, B=[[0.53764781]]), C, D)
    assert abs(found.value - np.linalg.norm(D)) <= min(found.error, 1e-8)
    assert fl.hinf_norm(fl.PeriodicSystem([[-0.1]], 1.0, B=[[1.0]]), [[0.0]], [[2.0]]).value == pytest.approx(2.0)


@pytest.mark.slow
def test_modes_that_numbers_do_not_hold_are_none_to_the_norm():
    """Where the damping is large, all but its zero is far: the norm is that of x' = -c t^2 x + u, which goes with its cube root."""
    damped = lambda a: fl.PeriodicSystem(lambda t: a * (np.cos(2 * np.pi * t) - 1)[:, None, None], 1.0, B=[[1.0]])  # noqa: E731
    few, many = (fl.hinf_norm(damped(a), [[1.0]]).value for a in (3e3, 8 * 3e3))
    assert few == pytest.approx(2 * many, rel=3e-3)


@pytest.mark.parametrize("weak", [1e-7, 0.0])
def test_an_oscillator_that_is_hardly_seen_beside_what_it_turns_with(weak):
    """Units by its share in the output made A 1e7 times as large there: sums that cancel hid the whole norm, which was refused."""
    A = np.diag([-0.4, 0.0, -0.02, -1e-5])
    A[1, 2], A[2, 1] = 1.0, -10.0
    B, C = np.ones((4, 1)), np.array([[1.0, weak, weak, 0.5]])
    exact, units = energy(A, B, C), np.array([[1e-6], [1.0], [1.0], [1e6]])
    far = fl.PeriodicSystem(units * A / units.T, 1.0, B=units * B), C / units.T
    for found in (fl.h2_norm(*turned(A, B, C, speed=4.3)), fl.h2_norm(*far)):
        assert abs(found.value - exact) <= found.error + 1e-11 * exact
        assert found.error <= 1e-9 * exact


J = np.array([[0.0, 1.0], [-1.0, 0.0]])


def draw_modes(seed):
    """Modes [[-s, v], [-v, -s]] or [[-s]] with inputs and outputs, damping ratios 1e-7 to 0.1; some unseen or not reached, or nearly."""
    rng = np.random.default_rng(seed)
    left, blocks = 2 + seed % 11, []
    while left:
        if left > 1 and rng.random() < 0.8:
            w, z = 10 ** rng.uniform(-1, 1.3), 10 ** rng.uniform(-7, -1)
            blocks.append(w * (np.sqrt(1 - z * z) * J - z * np.eye(2)))
        else:
            blocks.append(np.array([[-(10 ** rng.uniform(-2, 1))]]))
        left -= len(blocks[-1])
    m, p = rng.integers(1, 3, 2)
    inputs, outputs = ([rng.standard_normal((len(b), k)) for b in blocks] for k in (m, p))
    for k in range(1, len(blocks)):
        weak = (0.0, 10 ** rng.uniform(-14, -4))[rng.integers(0, 2)]
        kind = rng.integers(0, 6)
        inputs[k] *= weak if kind == 0 else 1.0
        outputs[k] *= weak if kind == 1 else 1.0
    return rng, (block_diag(*blocks), np.concatenate(inputs), np.concatenate(outputs).T)


def turn(rng, A, B, C):
    """x = P(t) M z of modes z: M mixes them, P rotates a plane with a period of 0.01 to 10 s."""
    n, speed = len(A), 2 * np.pi / 10 ** rng.uniform(-2, 1)
    scale = 10 ** rng.uniform(-1, 1, n)
    mix = np.linalg.qr(rng.standard_normal((n, n)))[0] * scale
    back = (mix / scale**2).T
    return turned(mix @ A @ back, mix @ B, C @ back, speed, *rng.permutation(n)[:2])


@pytest.mark.parametrize(
    ("norm", "known", "seed"),
    thin([(fl.hinf_norm, largest_gain, k) for k in range(50_000, 50_012)], 3)
    + thin([(fl.h2_norm, energy, k) for k in range(18, 30)], 2),
)
def test_no_norm_of_a_turned_system_misses_by_more_than_its_error(norm, known, seed):
    """Of modes that are hardly damped H2 norms were refused, or stated too well, by steps of second order."""
    rng, modes = draw_modes(seed)
    found, exact = norm(*turn(rng, *modes)), known(*modes)
    assert abs(found.value - exact) <= found.error + 1e-14 * exact
    assert found.error <= 0.05 * exact
