"""Sampled loops: the verdict against long simulations, and against what is known of constant plants."""

import control
import numpy as np
import pytest
from scipy.linalg import block_diag, expm

import flexlin as fl
from flexlin.control import lifted_model, sampled_floquet
from flexlin.errors import ArgumentError

T = np.pi
LOOPS = 16
"""Trials of the suite; 50 of them take half a minute."""


def matrices(t):
    """A damped pendulum whose pivot shakes: the plant of the random trials, written without flexlin."""
    A = np.zeros((*np.shape(t), 2, 2))
    A[..., 0, 1], A[..., 1, 1] = 1.0, -0.1
    A[..., 1, 0] = 0.6 + 0.5 * np.cos(2 * t)
    B = np.zeros((*np.shape(t), 2, 1))
    B[..., 1, 0] = 1.0 + 0.3 * np.sin(2 * t)
    return A, B


SHAKEN = fl.PeriodicSystem(lambda t: matrices(t)[0], T, lambda t: matrices(t)[1])


def gains(t):
    return np.stack([4.0 + np.cos(2 * t), 1.5 + 0.5 * np.sin(2 * t)], axis=-1)[..., None, :]


def growth_by_simulation(h, delay, samples=600, steps=8):
    """The growth rates (L,) of L loops, each with its own sampling time and delay, by classical Runge-Kutta steps."""
    rng = np.random.default_rng(8)
    x, u, logs, marks = rng.normal(size=(len(h), 2, 1)), np.zeros((len(h), 1, 1)), np.zeros(len(h)), []

    def rate(t, x, u):
        A, B = matrices(t)
        return A @ x + B @ u

    for k in range(samples):
        measured = -gains(k * h) @ x
        for begin, end, held in ((k * h, k * h + delay, u), (k * h + delay, (k + 1) * h, measured)):
            d = ((end - begin) / steps)[:, None, None]
            for s in range(steps):
                t = begin + d[:, 0, 0] * s
                half, whole = t + d[:, 0, 0] / 2, t + d[:, 0, 0]
                k1 = rate(t, x, held)
                k2 = rate(half, x + d / 2 * k1, held)
                k3 = rate(half, x + d / 2 * k2, held)
                x = x + d / 6 * (k1 + 2 * k2 + 2 * k3 + rate(whole, x + d * k3, held))
        u = measured
        size = np.sqrt((x**2).sum(axis=(1, 2)) + (u**2).sum(axis=(1, 2)))
        x, u, logs = x / size[:, None, None], u / size[:, None, None], logs + np.log(size)
        marks.append(logs.copy())
    return (marks[-1] - marks[samples // 5]) / (h * (samples - 1 - samples // 5)), 12 / (h * samples)


@pytest.mark.slow
def test_verdicts_agree_with_long_simulations_around_the_limit():
    """Random sampling times with random delays, most of them incommensurate with the period, a third close to the limit."""
    rng = np.random.default_rng(11)
    part = rng.uniform(0, 1, LOOPS)
    h = rng.uniform(0.15, 0.75, LOOPS)
    h[::10] = T / rng.integers(5, 12, len(h[::10]))
    simulated, blur = growth_by_simulation(h, part * h)
    found = [sampled_floquet(SHAKEN, gains, step, share * step, 1e-6) for step, share in zip(h, part, strict=True)]
    rates, errors = np.array([(result.exponents[0].real, result.errors[0]) for result in found]).T
    verdicts = np.array([result.verdict for result in found])
    assert np.abs(rates - simulated).max() < 0.05
    assert np.all(np.abs(rates - simulated) < blur + errors)
    decided = (np.abs(simulated) > blur) & (verdicts != "undecided")
    assert np.array_equal(verdicts[decided] == "stable", simulated[decided] < 0)
    assert (verdicts == "undecided").sum() <= 2
    assert LOOPS / 5 < (verdicts == "stable").sum() < 4 * LOOPS / 5


@pytest.mark.parametrize("part", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("memory", [0, 2])
def test_a_constant_plant_has_the_eigenvalues_of_one_sample(memory, part):
    """Without and with states of the controller, which follow a plant that was measured at the beginning of the sample."""
    rng, eye = np.random.default_rng(5), np.eye(memory)
    A, B, K = rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=(2, 3 + memory))
    rates = np.hstack([rng.normal(size=(memory, 3)), 0.3 * rng.normal(size=(memory, memory)) - 2 * eye])
    for h in (0.1, 0.23, 2.0):
        held = np.block([[A, B], [np.zeros((2, 5))]])
        (P0, G0), (P1, G1) = ((E[:3, :3], E[:3, 3:]) for E in (expm(held * part * h), expm(held * (1 - part) * h)))
        wide = expm(h * np.block([[rates[:, 3:], rates[:, :3]], [np.zeros((3, memory + 3))]]))[:memory]
        moved = [P1 @ P0 - G1 @ K[:, :3], -G1 @ K[:, 3:], P1 @ G0]
        step = np.block([moved, [wide[:, memory:], wide[:, :memory], np.zeros((memory, 2))], [-K, np.zeros((2, 2))]])
        known = np.linalg.eigvals(step)
        found = sampled_floquet(fl.PeriodicSystem(A, 2.0, B), K, h, part * h, rates=rates if memory else None)
        sound = np.isfinite(found.errors)
        off = np.abs(found.exponents.real[sound, None] - np.log(np.abs(known) + 1e-300) / h)
        assert np.all(off.min(axis=1) <= found.errors[sound] + 1e-12)
        assert off[0].argmin() == np.abs(known).argmax()
        assert found.errors[0] < 1e-9
        if h == 0.1:
            assert np.abs(found.multipliers[sound, None] - known**20).min(axis=1).max() < 1e-9


def test_the_lifted_model_is_the_sampled_plant():
    """Poles under the feedback of all samples, and the response to a random input, sample by sample."""
    N, part = 6, 0.3
    lifted = lifted_model(SHAKEN, T / N, part * T / N)
    assert isinstance(lifted, control.StateSpace)
    assert lifted.state_labels == ["x1", "x2", "u1_held"]
    assert lifted.dt == pytest.approx(T)
    K = gains(T * np.arange(N) / N)
    feed = block_diag(*K)
    poles = np.linalg.eigvals(lifted.A - lifted.B @ np.linalg.solve(np.eye(N) + feed @ lifted.D, feed @ lifted.C))
    found = sampled_floquet(SHAKEN, gains, T / N, part * T / N)
    assert np.abs(poles).max() == pytest.approx(np.abs(found.multipliers).max(), rel=1e-9)
    with pytest.raises(ArgumentError, match="such as sample_time"):
        lifted_model(SHAKEN, 0.5)
