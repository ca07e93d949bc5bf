"""Why a loop is unstable, and which numbers move its growth rate."""

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import flexlin as fl
from flexlin import sensitivity
from flexlin.answers import analyse
from flexlin.cli import main
from flexlin.report import advise, draw_sensitivity, record


@pytest.mark.slow
def test_a_parametric_resonance_is_named() -> None:
    # The link is Mathieu's equation with a near 4: its second tongue, where the mean frequency equals that of rotation.
    scene = fl.load_scene(
        "spinning-link", {"effects.gravity.acceleration": 10.0, "motion.joints.0.rate": 3.9, "accuracy.tol": 1e-7}
    )
    found = analyse(scene)
    assert found.own.verdict == "unstable"
    assert any("parametric resonance" in said and "2 × 0.6207 Hz" in said for said in advise(found))
    assert "order 2" in record(found)["resonances"][0]


def test_a_stable_loop_has_no_cause(single_link) -> None:
    assert single_link.resonances == ()


@pytest.mark.slow
def test_the_sensitivities_are_those_of_the_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = ["single-link", "--set", "links.0.modes=0", "designs=[]"]
    assert main(["report", *scene, "--sensitivity", "--out", str(tmp_path)]) == 0
    block = json.loads((tmp_path / "report.json").read_text())["sensitivity"]
    expected = sensitivity(fl.load_scene("single-link", {"links.0.modes": 0, "designs": []}))
    assert block["parameters"] == list(expected["parameter"].values)
    assert np.allclose(block["percent"], expected["percent"].values)
    assert 'id="sensitivity"' in (tmp_path / "report.html").read_text()
    picture = draw_sensitivity(expected)
    ElementTree.fromstring(picture.svg)
    assert picture.svg.count('z" style') == len(block["parameters"])
