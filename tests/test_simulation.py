"""The nonlinear judge: order of agreement with the linear model, energy, and honest failure."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.linearization import Law
from flexlin.simulation import simulate
from tests.closed_arm import closed, control_loop, opened
from tests.mechanics.scenes import plain_scene, swinging


def test_linear_model_is_the_slope_of_the_nonlinear_one():
    """Without gravity the forcing is odd in the amplitude, so the first neglected terms are cubic: halving it divides the gap by 8."""
    weightless = {"effects.gravity.acceleration": 0.0}
    arms = (closed(changes=weightless | {"motion.joints.0.amplitude": size}) for size in (0.2, 0.1))
    gaps = [simulate(lin, 0.5, tol=1e-10).difference for lin in arms]
    assert gaps[0] / gaps[1] == pytest.approx(8.0, rel=0.05)


def test_free_vibration_keeps_its_energy():
    """Two flexible links with payload and stiffening swing freely under gravity: no torque, no damping, no drift."""
    link = {"length": 0.6, "mass_per_length": 0.3, "bending_stiffness": 3.0, "modes": 1}
    effects = {"gravity": {}, "payload": {"mass": 0.1}, "geometric_stiffening": {}}
    still = swinging({"amplitude": 0.0, "mean": -1.2}, {"amplitude": 0.0})
    lin = control_loop(plain_scene([link, link], still, effects=effects, control={"feedforward": "none"}))
    run = simulate(lin, periods=1, tol=1e-10)
    s = run.nonlinear[:, :4] + lin.motion.sample(run.t)[0] @ lin.arm.reference.full().T
    energy = lin.arm.functions["energy"]
    values = np.array([float(energy(a, b, [])) for a, b in zip(s, run.nonlinear[:, 4:], strict=True)])
    assert np.ptp(s[:, 0]) > 0.5
    np.testing.assert_allclose(values, values[0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.torque, 0.0)
    assert run.energy_error < 1e-6


@pytest.mark.slow
def test_a_diverging_loop_is_told():
    lin = closed(changes={"control": {"feedforward": "none", "feedback": {"kind": "none"}}})
    with pytest.raises(FlexlinError):
        simulate(lin, periods=2, feedback=lambda t: np.full((len(t), 1, 6), -50.0))
    with pytest.raises(ArgumentError, match="initial"):
        simulate(lin, initial=np.zeros(3))
    assert isinstance(lin.arm.s, ca.SX)


DRIVEN = [
    (False, None, "the torque of the rigid motion alone"),
    (True, None, "the torque of the rigid motion and feedback"),
    (False, Law.constant([[0.0] * 6]), "no torque"),
    (False, Law.constant([[3.0, 0, 0, 0.5, 0, 0]]), "feedback alone"),
]


@pytest.mark.parametrize(("looped", "law", "words"), DRIVEN)
def test_it_says_what_moves_the_arm(looped, law, words):
    run = fl.simulate(closed() if looped else opened()[1], periods=0.02, tol=1e-4, law=law)
    assert run.driven_by == words
    assert f"driven by {words}" in run.summary()
