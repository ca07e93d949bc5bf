"""What comes from outside flexlin, and goes there.

An effect is one class and one call: scenes, `check`, `report` and `effects` then know all of it. Of a user's own models what is right
passes, and each mistake is named. The nonlinear arm stands in python-control.
"""

import json
from collections.abc import Iterator
from typing import Annotated

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.cli import BAD_INPUT, main
from flexlin.errors import ModelError
from flexlin.mechanics import Chain, Effect, Scale, register_effect
from flexlin.scene import NonNegative, Positive, Unit
from flexlin.scene import effects as tables

from .scenes import arm_of, random_state, swinging, value


class BearingSprings(Effect):
    """Torsion springs in the bearings, V = 1/2 sum k q^2, driven in place of a torque by a hydraulic pressure.

    This second paragraph is for readers of the code only.
    """

    lists = "each"
    input_unit = "bar"
    stiffness: Annotated[Positive | tuple[NonNegative, ...], Unit("N m/rad")]

    @classmethod
    def tried_with(cls, scale: Scale) -> "BearingSprings":
        return cls(stiffness=scale.of_inertias(4.0))

    @classmethod
    def contradictions(cls, raw: tables.RawTable, arm: tables.RawArm) -> Iterator[fl.errors.Problem]:
        for i, link in enumerate(arm.links):
            if link.get("joint") == "prismatic":
                yield fl.errors.Problem(f"links.{i}.joint", "'prismatic'", "'revolute' beside effects.bearing_springs")

    def potential_energy(self, chain: Chain) -> ca.SX:
        stiffness = self.stiffness if isinstance(self.stiffness, tuple) else (self.stiffness,) * len(chain.joints)
        return ca.dot(ca.vertcat(*stiffness), chain.q**2) / 2


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setattr(tables, "_REGISTRY", tables.known_effects())
    register_effect("bearing_springs", BearingSprings)


SCENE, RIGID = (["single-link", "--set", f"links.0.modes={modes}", "designs=[]"] for modes in (1, 0))
ON = [*SCENE, "effects.bearing_springs={stiffness=[2.5]}"]


WRONG = {
    "effects.bearing_springs={stiffness=-1.0}": ("effects.bearing_springs.stiffness", "greater than 0"),
    "effects.bearing_springs={stiffness=[1.0, 2.0]}": ("effects.bearing_springs.stiffness", "1, one for each link"),
    "effects.bearing_spring={stiffness=1.0}": ("effects.bearing_spring:", "did you mean 'bearing_springs'"),
}


def test_check_refuses_what_its_class_refuses(capsys):
    for override, words in WRONG.items():
        assert main(["check", *SCENE, override]) == BAD_INPUT
        told = capsys.readouterr().err
        assert all(word in told for word in words), told
    with pytest.raises(fl.errors.SceneError, match=r"links\.0\.joint: got 'prismatic'"):
        arm_of({"joint": "prismatic"}, effects={"bearing_springs": {"stiffness": 1.0}})


@pytest.mark.slow
def test_the_report_tells_of_it(tmp_path):
    assert main(["report", *ON, "--out", str(tmp_path)]) == 0
    data, text = json.loads((tmp_path / "report.json").read_text()), (tmp_path / "report.html").read_text()
    assert data["scene"]["effects"]["bearing_springs"] == {"stiffness": [2.5]}
    assert "bearing_springs" in data["effects"]["on"]
    assert data["effects"]["units"]["bearing_springs"] == {"stiffness": "N m/rad"}
    for words in ("Torsion springs in the bearings, V = 1/2 sum k q²", "2.5 N m/rad", "input q1 in bar"):
        assert words in text.replace("\u00a0", " ")
    assert "second paragraph" not in text


@pytest.mark.slow
def test_the_audit_tries_it_with_its_own_figures(tmp_path, capsys):
    assert main(["effects", *RIGID, "--out", str(tmp_path)]) == 0
    told, rows = capsys.readouterr().out, json.loads((tmp_path / "effects.json").read_text())["rows"]
    (row,) = (row for row in rows if row["subject"] == "bearing_springs")
    assert not row["on"]
    assert row["units"] == {"stiffness": "N m/rad"}
    arm = fl.build_manipulator(fl.load_scene("single-link", {"links.0.modes": 0, "designs": []}))
    inertia = value(arm, "M", np.zeros(1))[0, 0]
    np.testing.assert_allclose(row["table"]["stiffness"], [4 * inertia], rtol=1e-12)
    assert "with bearing_springs" in told
    assert f"bearing_springs: stiffness {4 * inertia:.4g} N m/rad" in told


def test_its_numbers_may_be_free_and_its_absence_costs_nothing():
    bare, sprung = arm_of({}, {}), arm_of({}, {}, effects={"bearing_springs": {"stiffness": [2.0, 3.0]}})
    s, *_ = random_state(bare)
    added = value(sprung, "g", s) - value(bare, "g", s)
    np.testing.assert_allclose(added[:, 0], [2.0 * s[0], 3.0 * s[1], *np.zeros(bare.n - 2)], atol=1e-12)
    assert bare.functions["g"].n_instructions() < sprung.functions["g"].n_instructions()
    assert bare.names == sprung.names
    scene = fl.load_scene("single-link", {"effects.bearing_springs": {"stiffness": 2.0}})
    free = fl.build_manipulator(scene, ["effects.bearing_springs.stiffness"])
    assert free.parameters.values.tolist() == [2.0]


def test_its_name_must_be_free_and_its_class_an_effect():
    for taken in ("gravity", "bearing_springs", "model_copy", "on", "tip spring"):
        with pytest.raises(fl.errors.ArgumentError, match="name"):
            register_effect(taken, BearingSprings)
    with pytest.raises(fl.errors.ArgumentError, match="no effect"):
        register_effect("table", tables.Table)


def test_a_dumped_scene_loads_as_the_same_scene():
    scene = fl.load_scene("single-link", {"effects.bearing_springs": {"stiffness": 2.0}})
    assert fl.parse_scene(scene.model_dump(mode="json", by_alias=True, exclude_unset=True)) == scene


S, RATE = ca.SX.sym("s", 2), ca.SX.sym("s_dot", 2)
COS, SIN = ca.cos(S[1]), ca.sin(S[1])


def two_rods(**wrong):
    """Two rods of unit length and mass, joint angles relative; `wrong` replaces a matrix."""
    h = SIN / 2
    parts = {
        "M": ca.blockcat([[5 / 3 + COS, 1 / 3 + COS / 2], [1 / 3 + COS / 2, 1 / 3]]),
        "C": ca.blockcat([[-h * RATE[1], -h * (RATE[0] + RATE[1])], [h * RATE[0], 0]]),
        "g": 9.81 * ca.vertcat(1.5 * ca.cos(S[0]) + 0.5 * ca.cos(S[0] + S[1]), 0.5 * ca.cos(S[0] + S[1])),
    }
    return fl.Manipulator.from_matrices(S, RATE, **(parts | wrong))


def changed(matrix, i, j, value):
    copy = ca.SX(matrix)
    copy[i, j] = value
    return copy


def test_a_right_model_passes_and_equals_its_lagrangian():
    arm = two_rods()
    T, V = ca.bilin(arm.M, RATE, RATE) / 2, 9.81 * (1.5 * ca.sin(S[0]) + 0.5 * ca.sin(S[0] + S[1]))
    other = fl.Manipulator.from_lagrangian(S, RATE, T, V)
    state = np.random.default_rng(0).normal(size=(3, 2))
    np.testing.assert_allclose(value(arm, "residual", *state), value(other, "residual", *state), rtol=1e-12)


def test_any_true_factorisation_of_the_coriolis_forces_passes():
    """C = dM/ds (I (x) s') - 1/2 (dM/ds (s' (x) I))^T is not skew with M', but is the same force."""
    M = two_rods().M
    dM = fl.kronecker.derivative(M, S)
    eye = ca.DM.eye(2)
    other = two_rods(C=dM @ ca.kron(eye, RATE) - (dM @ ca.kron(RATE, eye)).T / 2)
    state = np.random.default_rng(1).normal(size=(3, 2))
    np.testing.assert_allclose(value(other, "residual", *state), value(two_rods(), "residual", *state), rtol=1e-12)
    assert np.abs(value(other, "C", *state[:2]) - value(two_rods(), "C", *state[:2])).max() > 1e-3


RIGHT = two_rods()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"M": changed(RIGHT.M, 0, 1, 0.4)}, r"M is not symmetric.*M\[1, 0\].*M\[0, 1\]|M\[0, 1\].*M\[1, 0\]"),
        ({"M": changed(RIGHT.M, 1, 1, -0.1)}, r"not positive definite.*M\[1, 1\]"),
        ({"M": changed(RIGHT.M, 1, 1, 1 / (S[0] - S[0] * 1.0))}, r"M\[1, 1\] is not finite"),
        ({"M": changed(RIGHT.M, 1, 1, 1 + RATE[0] ** 2)}, r"M\[1, 1\] depends on the rates"),
        ({"C": changed(RIGHT.C, 1, 0, -SIN / 2 * RATE[0])}, r"row 1 of C s' the product s1' s1'.*skew"),
        ({"C": ca.SX.zeros(2, 2)}, "C does not belong to M"),
        ({"g": changed(RIGHT.g, 1, 0, ca.sin(S[0]))}, r"dg/ds is not symmetric"),
        ({"g": changed(RIGHT.g, 1, 0, RATE[0])}, r"g\[1, 0\] depends on the rates"),
        ({"damping": ca.vertcat(ca.log(S[0] - 7), 0)}, r"damping\[0, 0\] is not finite"),
        ({"g": RIGHT.g[0]}, "g has the wrong shape"),
        ({"g": RIGHT.g + ca.SX.sym("mystery")}, "mystery"),
    ],
)
def test_each_mistake_is_named(wrong, message):
    with pytest.raises(ModelError, match=message):
        two_rods(**wrong)


@pytest.mark.parametrize(
    ("T", "V", "says"),
    [
        (RATE[0] ** 2, S[0] ** 2, "not positive definite"),
        (ca.sumsqr(RATE), S[0] * RATE[0], "rates"),
        (ca.sumsqr(RATE) ** 2 + ca.sumsqr(RATE), S[0] ** 2, "rates"),
        (ca.sumsqr(RATE) / 2 + RATE[1] * SIN, ca.SX(0), "linear in rate 1"),
        (ca.sumsqr(RATE) / 2 + 1 + S[0] ** 2, ca.SX(0), "free of the rates"),
    ],
)
def test_energies_must_be_mechanical(T, V, says):
    """The Kronecker route knows M and C only: a part of T that is not quadratic would be lost in silence."""
    with pytest.raises(ModelError, match=says):
        fl.Manipulator.from_lagrangian(S, RATE, T, V)


def test_a_model_must_stay_finite_along_the_motion():
    """A root of 1.2 - s1 is sound about rest, and not where the motion goes."""
    arm = fl.Manipulator.from_lagrangian(S, RATE, ca.sumsqr(RATE), ca.sumsqr(S) + (1.2 - S[0]) ** 1.5)
    with pytest.raises(ModelError, match=r"K_L\[0, 0\] is not finite along the motion, at t = "):
        fl.linearize(arm, swinging({"amplitude": 1.5}, {"amplitude": 0.1}))


PAYLOAD = "effects.payload.mass"


def test_names():
    flexible = {"joint_flexibility": {"stiffness": [50.0, 0.0], "motor_inertia": 0.05}}
    plant = arm_of({}, {"modes": 0}, effects=flexible).to_control("plant")
    assert plant.name == "plant"
    assert plant.state_labels == plant.output_labels
    assert plant.state_labels[:4] == ["q1", "q2", "w11", "w12"]
    assert plant.state_labels[-1] == "theta1_rate"
    assert plant.input_labels == ["theta1", "q2"]


def test_its_rates_solve_the_equations():
    """M s'' + C s' + g + d = B u, by the arm's own residual."""
    motor = {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": 50.0}
    arm = arm_of({}, {}, effects={"gravity": {}, "geometric_stiffening": {}, "motor": motor})
    s, s_dot, _ = random_state(arm)
    u = np.array([3.0, -2.0])
    rates = arm.to_control().dynamics(0.0, np.concatenate([s, s_dot]), u)
    np.testing.assert_array_equal(rates[: arm.n], s_dot)
    left = value(arm, "residual", s, s_dot, rates[arm.n :])[:, 0]
    np.testing.assert_allclose(left, np.append(1.25 * u, np.zeros(4)), atol=1e-10)


def test_free_parameters_are_those_of_the_system():
    plain, heavy = (fl.load_scene("single-link", {"designs": []} | more) for more in ({}, {PAYLOAD: 0.3}))
    plant, x, u = fl.build_manipulator(plain, [PAYLOAD]).to_control(), [-1.0, 0.01, 0.0, 0.2, 0.0, 0.1], np.zeros(1)
    assert plant.params == {PAYLOAD: plain.effects.payload.mass}
    expected = fl.build_manipulator(heavy).to_control().dynamics(0.0, x, u)
    np.testing.assert_allclose(plant.dynamics(0.0, x, u, params={PAYLOAD: 0.3}), expected, rtol=1e-10)


def test_a_periodic_load_needs_the_period():
    arm = arm_of({"modes": 0}, effects={"tip_force": {"torque": [0.0, 0.0, 0.4], "harmonic": 2}})
    with pytest.raises(fl.errors.ArgumentError, match="a periodic load needs a period"):
        arm.to_control()
    plant, inertia = arm.to_control(period=0.5), value(arm, "M", np.zeros(1))[0, 0]
    found = [plant.dynamics(t, np.zeros(2), np.zeros(1))[1] for t in (0.0, 0.05, 0.625)]
    np.testing.assert_allclose(found, 0.4 / inertia * np.cos(8 * np.pi * np.array([0.0, 0.05, 0.625])), atol=1e-9)
