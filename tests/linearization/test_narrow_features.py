"""A turn-around under Coulomb friction is a pulse of damping: no verdict may step over it."""

import numpy as np
import pytest

import flexlin as fl
from flexlin import sweep
from tests.closed_arm import control_loop

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
    data = sweep(scene(20.0, 0.3, 0.01), {"effects.coulomb_friction.rate": rates}, 1e-6)
    assert data["exponents"].values.real.max(axis=1) == pytest.approx(limit(20.0), rel=2e-3)
