"""The nonlinear judge: order of agreement with the linear model, energy, and honest failure."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.linearization import Law
from flexlin.scene import parse_scene
from flexlin.simulation import simulate
from tests.closed_arm import closed


def test_linear_model_is_the_slope_of_the_nonlinear_one():
    """Without gravity the forcing is odd in the amplitude, so the first neglected terms are cubic: halving it divides the gap by 8."""
    gaps = [
        simulate(
            closed(changes={"motion.joints.0.amplitude": a, "effects.gravity.acceleration": 0.0}), 0.5, tol=1e-10
        ).difference
        for a in (0.2, 0.1)
    ]
    assert gaps[0] / gaps[1] == pytest.approx(8.0, rel=0.05)


def test_free_vibration_keeps_its_energy():
    """Two flexible links with payload and stiffening swing freely under gravity: no torque, no damping, no drift."""
    link = {"length": 0.6, "mass_per_length": 0.3, "bending_stiffness": 3.0, "modes": 1}
    scene = parse_scene(
        {
            "schema": 1,
            "title": "free",
            "links": [link, link],
            "effects": {"gravity": {}, "payload": {"mass": 0.1}, "geometric_stiffening": {}},
            "motion": {
                "kind": "harmonic",
                "frequency": 1.0,
                "joints": [{"amplitude": 0.0, "mean": -1.2}, {"amplitude": 0.0}],
            },
            "control": {"feedforward": "none"},
        }
    )
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    run = simulate(lin, periods=1, tol=1e-10)
    s = run.nonlinear[:, :4] + lin.motion.sample(run.t)[0] @ lin.arm.reference.full().T
    energy = lin.arm.functions["energy"]
    values = np.array([float(energy(a, b, [])) for a, b in zip(s, run.nonlinear[:, 4:], strict=True)])
    assert np.ptp(s[:, 0]) > 0.5
    np.testing.assert_allclose(
        values, values[0], rtol=0, atol=1e-7 * np.ptp(values - values[0] + np.abs(values[0])) + 1e-7
    )
    np.testing.assert_allclose(run.torque, 0.0)
    assert run.energy_error < 1e-6


def test_a_given_feedback_equals_the_same_gains_in_the_scene():
    lin = closed()
    gain = lin.law.gain(np.zeros(1))[0]
    again = simulate(lin, periods=0.5, feedback=lambda t: np.broadcast_to(gain, (len(t), *gain.shape)))
    own = simulate(lin, periods=0.5)
    np.testing.assert_allclose(again.nonlinear, own.nonlinear, atol=1e-9)
    np.testing.assert_allclose(again.linear, own.linear, atol=1e-12)


def test_table_motion_and_symbolic_motion_agree(tmp_path):
    """The same sine, once as formula and once as 400 samples of it."""
    t = np.linspace(0.0, 2.0, 401)
    table = tmp_path / "sine.csv"
    np.savetxt(table, np.column_stack([t, 0.5 * np.sin(np.pi * t)]), delimiter=",", header="t,q1", comments="")
    one = simulate(closed(), periods=0.5)
    other = simulate(closed(changes={"motion": {"kind": "table", "file": str(table)}}, folder=tmp_path), periods=0.5)
    np.testing.assert_allclose(other.tip, one.tip, atol=1e-7)


def test_results_carry_names_errors_and_units():
    run = simulate(closed(), periods=0.25)
    data = run.to_xarray()
    assert data["nonlinear"].dims == ("time", "state")
    assert list(data["state"].values) == ["q1", "w11", "w12", "q1_rate", "w11_rate", "w12_rate"]
    assert 0 < run.error < 1e-6
    assert "linear model holds" in run.status
    np.testing.assert_allclose(np.linalg.norm(run.tip_rigid, axis=1), 0.96, rtol=1e-12)


@pytest.mark.slow
def test_a_diverging_loop_is_told():
    lin = closed(changes={"control": {"feedforward": "none", "feedback": {"kind": "none"}}})
    with pytest.raises(FlexlinError):
        simulate(lin, periods=2, feedback=lambda t: np.full((len(t), 1, 6), -50.0))
    with pytest.raises(ArgumentError, match="initial"):
        simulate(lin, initial=np.zeros(3))
    assert isinstance(lin.arm.s, ca.SX)


@pytest.mark.parametrize(
    ("looped", "law", "words"),
    [
        (False, None, "the torque of the rigid motion alone"),
        (True, None, "the torque of the rigid motion and feedback"),
        (False, Law.constant([[0.0] * 6]), "no torque"),
        (False, Law.constant([[3.0, 0, 0, 0.5, 0, 0]]), "feedback alone"),
    ],
)
def test_it_says_what_moves_the_arm(looped, law, words):
    scene = fl.load_scene("single-link")
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control if looped else None)
    run = fl.simulate(lin, periods=0.02, tol=1e-4, law=law)
    assert run.driven_by == words
    assert f"driven by {words}" in run.summary()
