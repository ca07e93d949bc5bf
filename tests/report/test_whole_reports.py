"""Whole reports: what is missing is said; the elastic motion, exact feedforward, arms that leave the plane, motions that end."""

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray

import flexlin as fl
from flexlin.analyses import analyse
from flexlin.cli import main
from flexlin.report import advise, draw_sensitivity, record, to_json


@pytest.mark.slow
def test_a_design_without_an_answer_is_told_and_the_others_stand(report, tmp_path: Path) -> None:
    table = "designs=[{name='blind', kind='frozen-lqr', state_weight=[0.0, 0.0], input_weight=[1.0]}]"
    scene = ["single-link", "--set", "links.0.modes=0", "effects.gravity=off", table]
    ran = report(*scene)
    blind = ran.data["designs"]["blind"]
    assert (ran.code, ran.data["floquet"]["verdict"], blind["verdict"]) == (4, "stable", "failed")
    assert "weight Q" in blind["status"]
    assert "no answer" in ran.page
    assert "has no answer" in ran.out
    assert main(["design", *scene, "--out", str(tmp_path)]) == 4


def test_a_motion_without_a_periodic_response_says_so(report) -> None:
    ran = report("single-link", "--set", "links.0.modes=0", "effects.gravity=off", "control={}", "designs=[]")
    assert (ran.code, ran.data["floquet"]["verdict"]) == (0, "undecided")
    assert "multiplier" in ran.data["forced_response"]["problem"]
    assert "No periodic response was found" in ran.out


@pytest.mark.slow
def test_a_parametric_resonance_is_named() -> None:
    # The link is Mathieu's equation with a near 4: its second tongue, where the mean frequency equals that of rotation.
    changes = {"effects.gravity.acceleration": 10.0, "motion.joints.0.rate": 3.9, "accuracy.tol": 1e-7}
    found = analyse(fl.load_scene("spinning-link", changes))
    assert found.own.verdict == "unstable"
    assert any("parametric resonance" in said and "2 × 0.6207 Hz" in said for said in advise(found))
    assert "order 2" in record(found)["resonances"][0]


@pytest.mark.slow
def test_the_sensitivities_are_those_of_the_library(report) -> None:
    ran = report("single-link", "--set", "links.0.modes=0", "designs=[]", "--sensitivity")
    block = ran.data["sensitivity"]
    expected = fl.sensitivity(fl.load_scene("single-link", {"links.0.modes": 0, "designs": []}))
    assert block["parameters"] == list(expected["parameter"].values)
    assert np.allclose(block["percent"], expected["percent"].values)
    assert 'id="sensitivity"' in ran.page
    picture = draw_sensitivity(expected)
    ElementTree.fromstring(picture.svg)
    assert picture.svg.count('z" style') == len(block["parameters"])


@pytest.mark.slow
def test_the_elastic_motion_is_judged_beside_the_rigid_one():
    changes = {"links.0.modes": 1, "designs": [], "control.about": "elastic", "accuracy.tol": 1e-6}
    found = analyse(fl.load_scene("single-link", changes))
    assert [loop.kind for loop in found.loops] == ["open", "pd", "elastic"]
    assert found.elastic.verdict == found.own.verdict == "stable"
    assert found.elastic.growth[0] == pytest.approx(found.own.growth[0], rel=0.3)
    assert found.elastic.growth[0] != found.own.growth[0]
    assert any("elastic motion" in said and "verdict stands" in said for said in advise(found))
    assert record(found)["elastic_motion"]["verdict"] == "stable"


EXACT = {"links.0.modes": 1, "control.feedforward": "tip-exact", "accuracy.tol": 1e-6, "designs": [], "drives": {}}


@pytest.mark.slow
def test_the_report_follows_the_elastic_motion():
    rigid = {**EXACT, "control.feedforward": "rigid"}
    found, plain = (analyse(fl.load_scene("single-link", changes)) for changes in (EXACT, rigid))
    forward = fl.control.feedforward(found.closed, "tip-exact", tol=1e-8)
    assert found.response.tip_error.max() == pytest.approx(forward.tip_error, rel=1e-3)
    assert found.response.tip_error.max() < 0.05 * plain.response.tip_error.max()
    assert found.simulation.tip_error == pytest.approx(forward.tip_error, rel=0.05)
    np.testing.assert_allclose(found.load(found.own).torque, forward.torque(found.t[:-1]), atol=1e-9)
    assert np.array_equal(found.own.floquet.exponents, plain.own.floquet.exponents)
    assert to_json(record(found))
    assert "tip-exact feedforward" in " ".join(advise(found))


TILTED = ["links.0.mount.rpy=[1.5707963267948966,0,0]", "effects.gravity.direction=[0,0,-1]"]


@pytest.mark.slow
@pytest.mark.parametrize("extra", [[], ["effects.geometric_stiffening=off"]])
def test_an_arm_that_swings_in_another_plane_is_the_same_arm(extra, tmp_path):
    """The single link turned by a right angle about x, gravity with it: tip errors and exponents are those of the plane."""
    found = []
    for name, tilt in (("plane", []), ("tilted", TILTED)):
        out, changes = tmp_path / name, ["links.0.modes=1", "designs=[]", *tilt, *extra]
        assert main(["report", "single-link", "--tol", "1e-6", "--set", *changes, "--out", str(out)]) == 0
        found.append(json.loads((out / "report.json").read_text()))
        assert main(["simulate", "single-link", "--periods", "0.1", "--set", *changes, "--out", str(out)]) == 0
    plane, tilted = found
    for (a, b), (c, d) in zip(plane["floquet"]["exponents"], tilted["floquet"]["exponents"], strict=True):
        assert (a, b) == pytest.approx((c, d), abs=1e-5 * max(1, abs(a)))
    with xarray.open_dataset(tmp_path / "tilted" / "simulation.nc", engine="scipy") as data:
        assert [str(axis) for axis in data["axis"].values] == ["x", "y", "z"]


WEIGHTS = 'weights={joints="1 deg", rates="30 deg/s", deflection="10 mm", deflection_rates=1.0, input="1 N m"}'
DESIGNS = f'designs=[{{name="end", kind="finite-horizon-lqr", {WEIGHTS}}}]'
MOTION = "motion={kind='point-to-point', move_time=0.5, dwell_time=0.2, course='one-way', joints=[{waypoints=[0,1]}]}"
SETS = ["--set", "links.0.modes=1", MOTION, DESIGNS, "--tol", "1e-5"]


@pytest.mark.slow
def test_a_report_of_a_motion_that_ends(report):
    ran = report("single-link", *SETS)
    assert ran.code == 0
    assert "the motion ends after" in ran.out
    assert "nan" not in ran.out
    assert ran.data["floquet"]["verdict"] == ran.data["designs"]["end"]["verdict"] == "one-way"
    assert ran.data["simulation"]["t"][-1] == pytest.approx(1.5 * ran.data["period"])
    assert "Multipliers" not in ran.page


@pytest.mark.slow
def test_its_gain_is_designed_and_exported(tmp_path, capsys):
    assert main(["design", "single-link", *SETS, "--points", "32", "--out", str(tmp_path / "d")]) == 0
    with np.load(tmp_path / "d" / "gains.npz") as arrays:
        assert np.abs(np.diff(arrays["K"], axis=1)).max() > 0
    assert main(["export", "single-link", *SETS, "--points", "8", "--out", str(tmp_path / "e")]) == 0
    header = (tmp_path / "e" / "c-end" / "gain.h").read_text()
    assert "held at 0 before the motion and at 1 after it" in header
    assert "min(max(time, 0), t(end))" in (tmp_path / "e" / "load_arm.m").read_text()
    assert main(["simulate", "single-link", *SETS, "--periods", "1.2", "--out", str(tmp_path / "s")]) == 0
    other = [text.replace("finite-horizon-lqr", "averaged-lqr") for text in SETS]
    assert main(["design", "single-link", *other, "--out", str(tmp_path / "x")]) == 2
    assert 'expected kind = "finite-horizon-lqr"' in capsys.readouterr().err


def test_no_feedback_can_be_said_in_words():
    """kind = "none" is the arm without feedback, and takes no gains."""
    said, left_out = (fl.load_scene("single-link", {"control.feedback": value}) for value in ({"kind": "none"}, None))
    assert said == left_out
    with pytest.raises(fl.errors.SceneError, match="alone"):
        fl.load_scene("single-link", {"control.feedback": {"kind": "none", "kp": [1.0]}})
