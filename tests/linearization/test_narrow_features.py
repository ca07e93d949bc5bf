"""Narrow features, of friction and of loops near their dead points: none goes unnamed, and no verdict steps over one."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.linearization import parametric_loop
from tests.closed_arm import control_loop
from tests.mechanics.scenes import linear, plain_scene, swinging
from tests.thinned import thin

J, TORQUE, DAMPING, AMPLITUDE = 0.4 * 0.5**3 / 3, 0.02, 0.001, 0.5


def scene(frequency: float, phase: float, rate: float):
    """A rigid link of 0.5 m and 0.4 kg/m under a PD loop, with friction in its joint."""
    joints, feedback = [{"amplitude": AMPLITUDE, "phase": phase}], {"kind": "pd", "kp": [0.2], "kd": [DAMPING]}
    changes = {
        "links": [{"length": 0.5, "mass_per_length": 0.4, "modes": 0}],
        "effects": {"coulomb_friction": {"torque": TORQUE, "rate": rate}},
        "motion": {"kind": "harmonic", "frequency": frequency, "joints": joints},
        "control": {"feedback": feedback},
    }
    return fl.load_scene("single-link", {**changes, "designs": []})


def limit(frequency: float) -> float:
    """Growth rate as the rate goes to zero: half the mean damping over J, friction adding 4 c/(|q''| T) in two turn-arounds."""
    return -(DAMPING + 4 * TORQUE * frequency / (AMPLITUDE * (2 * np.pi * frequency) ** 2)) / (2 * J)


def growth(frequency: float, phase: float, rate: float) -> float:
    lin = control_loop(scene(frequency, phase, rate))
    return float(fl.floquet(lin.periodic_system()).exponents[0].real)


def test_the_known_answer_of_a_slow_motion():
    assert growth(1.0, 0.0, 1e-3) == pytest.approx(-0.15158543, abs=2e-8)


@pytest.mark.parametrize("rate", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize(("frequency", "phase"), [(1.0, 0.3), (20.0, 0.3), (20.0, 0.0)])
def test_pulses_of_any_width_are_met(frequency, phase, rate):
    """An integrator that steps over them finds -0.03 instead."""
    assert growth(frequency, phase, rate) == pytest.approx(limit(frequency), rel=2e-3)


def test_a_sweep_meets_them_too():
    rates = np.array([1e-2, 1e-4])
    data = fl.sweep(scene(20.0, 0.3, 0.01), {"effects.coulomb_friction.rate": rates}, 1e-6)
    assert data["exponents"].values.real.max(axis=1) == pytest.approx(limit(20.0), rel=2e-3)


def stretched(gap):
    """A five-bar whose distal links come within `gap` of being stretched, at half the period; the rigid motion turns both bases alike.

    The distance of the elbows is base + 0.4 cos x, x = 0.9 sin(2 pi t / T); the dead point at 0.6 lies at x = i sqrt(5 gap).
    """
    base = {"parent": "base", "mount": {"xyz": [0.2 - gap, 0.0, 0.0]}}
    more = [{}, {"passive": True, "name": "left"}, base, {"passive": True, "name": "right"}]
    posture = [np.pi - 0.15, -2.87, 0.15, 2.87]
    bars = [{"length": 0.2 + 0.1 * (k % 2), "mass_per_length": 0.1, "posture": posture[k], **more[k]} for k in range(4)]
    motion = swinging({"mean": np.pi, "amplitude": 0.9, "phase": np.pi}, {"mean": 0.0, "amplitude": 0.9})
    return linear(plain_scene(bars, motion, loops=[{"link": "left", "to": "right"}]))


@pytest.mark.parametrize("gap", thin([0.02, 1e-4, 3e-4]))
def test_what_is_complete_is_right_between_its_samples(gap):
    lin = stretched(gap)
    width = np.arcsinh(np.sqrt(5 * gap) / 0.9) / (2 * np.pi)  # of the dead point from real times, in periods
    assert lin.complete == (width > 1 / 100)
    resolved = lin.periodic_system().resolved
    t = lin.period * np.concatenate([np.random.default_rng(1).random(2000), 0.5 + 1e-3 * np.linspace(-1, 1, 201)])
    exact = np.concatenate(lin.equations(t), axis=2)
    assert np.all(np.abs(resolved.series(t) - exact) <= 2 * resolved.error + 1e-15 * np.abs(exact).max(axis=0))


@pytest.mark.parametrize("path", ["motion.frequency", "motion.joints.0.mean"])
def test_loops_at_other_numbers_are_looked_at_for_dead_points_too(path):
    loop = parametric_loop(fl.load_scene("spatial-four-bar"), [path])
    assert loop.at(1.01 * loop.nominal).complete
