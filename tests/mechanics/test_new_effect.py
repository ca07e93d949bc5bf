"""An effect from outside is one class and one call: scenes, `check`, `report` and `effects` then know all of it."""

import json
from collections.abc import Iterator
from typing import Annotated

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.cli import BAD_INPUT, main
from flexlin.mechanics import Chain, Effect, Scale, register_effect
from flexlin.scene import NonNegative, Positive, Unit
from flexlin.scene import effects as tables

from .scenes import arm_of, random_state, value


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


def test_check_knows_it(capsys):
    for words, known in ((ON, True), (SCENE, False)):
        assert main(["check", *words]) == 0
        assert ("bearing_springs" in capsys.readouterr().out) == known


WRONG = {
    "effects.bearing_springs={stiffness=-1.0}": ("effects.bearing_springs.stiffness", "greater than 0"),
    "effects.bearing_springs={stiffness=[1.0, 2.0]}": ("effects.bearing_springs.stiffness", "1, one for each link"),
    "effects.bearing_springs={stifness=1.0}": ("effects.bearing_springs.stifness", "did you mean 'stiffness'"),
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
