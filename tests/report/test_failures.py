"""What cannot be had is said, and the rest of the report stands."""

import json
from pathlib import Path

import pytest

from flexlin.cli import main


@pytest.mark.slow
def test_a_design_without_an_answer_is_told_and_the_others_stand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blind = "designs=[{name='blind', kind='frozen-lqr', state_weight=[0.0, 0.0], input_weight=[1.0]}]"
    scene = ["single-link", "--set", "links.0.modes=0", "effects.gravity=off", blind, "--out", str(tmp_path)]
    assert main(["report", *scene]) == 0
    data, page = json.loads((tmp_path / "report.json").read_text()), (tmp_path / "report.html").read_text()
    assert data["floquet"]["verdict"] == "stable"
    assert data["designs"]["blind"]["verdict"] == "failed"
    assert "weight Q" in data["designs"]["blind"]["status"]
    assert "no answer" in page
    assert "has no answer" in capsys.readouterr().out
    assert main(["design", *scene]) == 4


def test_a_motion_without_a_periodic_response_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    free = ["--set", "links.0.modes=0", "effects.gravity=off", "control={}", "designs=[]", "--out", str(tmp_path)]
    assert main(["report", "single-link", *free]) == 0
    data = json.loads((tmp_path / "report.json").read_text())
    assert data["floquet"]["verdict"] == "undecided"
    assert "multiplier" in data["forced_response"]["problem"]
    assert "No periodic response was found" in capsys.readouterr().out
