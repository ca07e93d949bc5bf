"""Motions that end: every command takes them, and says that they have no exponents."""

import json

import numpy as np
import pytest

import flexlin as fl
from flexlin.cli import main

DESIGN = '{name="end", kind="KIND", weights={joints="1 deg", rates="30 deg/s", deflection="10 mm", deflection_rates=1.0, input="1 N m"}}'
MOTION = (
    'motion={kind="point-to-point", move_time=0.5, dwell_time=0.2, course="one-way", joints=[{waypoints=[0.0, 0.8]}]}'
)
SETS = [
    "--set",
    "links.0.modes=1",
    MOTION,
    "designs=[" + DESIGN.replace("KIND", "finite-horizon-lqr") + "]",
    "--tol",
    "1e-5",
]


@pytest.mark.slow
def test_a_report_of_a_motion_that_ends(tmp_path, capsys):
    assert main(["report", "single-link", *SETS, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "the motion ends after" in said
    assert "nan" not in said
    data = json.loads((tmp_path / "report.json").read_text())
    assert data["floquet"]["verdict"] == data["designs"]["end"]["verdict"] == "one-way"
    assert data["simulation"]["t"][-1] == pytest.approx(1.5 * data["period"])
    assert "Multipliers" not in (tmp_path / "report.html").read_text()


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
