"""The audit of effects as picture, data and lines."""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from flexlin.analyses import Audit, Measure, Row
from flexlin.cli import main
from flexlin.report import audit_block, audit_lines, draw_effects, to_json


def row(subject: str, on: bool, significance: float, verdict: str = "stable", problem: str = "", **table: Any) -> Row:
    change, measures = f"{'without' if on else 'with'} {subject}", (0.1, 0.2, 0.3, 4, 5.0, 6)
    return Row(change, "effect", subject, on, table, *measures, verdict, significance, "advice", problem)


@pytest.fixture
def audited() -> Audit:
    base = Measure(-1.0, 1e-9, "stable", np.array([1.0]), 0.01, 3, 100, 1.0)
    rows = (
        row("gravity", True, np.inf, "unstable"),
        row("payload", True, 0.5),
        row("motor", False, 0.02, static=None, gear_ratio=2.0),
        row("hub", True, 0.0),
        row("shear", False, np.nan, "unknown", "it cannot be judged"),
    )
    return Audit(base, rows, (), 0.01)


def test_the_picture_shows_every_change_and_a_bar_for_each_that_was_judged(audited: Audit) -> None:
    picture = draw_effects(audited)
    ElementTree.fromstring(picture.svg)
    for change in ("without gravity", "without payload", "with motor", "without hub", "with shear"):
        assert change in picture.svg
    assert "nan" not in picture.svg
    assert picture.svg.count("fill:var(--blue)") == 2
    assert picture.svg.count("fill:var(--orange)") == 1
    assert "needed: gravity, payload" in picture.caption


def test_the_data_survive_what_json_cannot_hold(audited: Audit) -> None:
    data = json.loads(to_json(audit_block(audited)))
    assert data["needed"] == ["gravity", "payload"]
    assert data["droppable"] == ["hub"]
    assert [entry["significance"] for entry in data["rows"]] == [None, 0.5, 0.02, 0.0, None]


def test_the_lines_are_sorted_and_tell_the_problem(audited: Audit) -> None:
    lines = audit_lines(audited)
    assert [line.split()[1] for line in lines[1:6]] == ["gravity", "payload", "motor", "hub", "shear"]
    assert "it cannot be judged" in lines[5]
    assert lines[6].startswith("the scene: stable, −1 ± 1×10⁻⁹ 1/s")
    assert lines[7] == "effects of the scene, with its figures"
    assert lines[8:11] == ["  gravity: none", "  payload: none", "  hub: none"]
    assert lines[11:] == ["effects that are off were tried with", "  motor: gear_ratio 2", "  shear: none"]


@pytest.mark.slow
def test_the_command_and_the_report_agree(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = ["single-link", "--set", "links.0.modes=0", "designs=[]", "--out", str(tmp_path)]
    assert main(["effects", *scene]) == 0
    assert main(["report", *scene, "--effects"]) == 0
    alone = json.loads((tmp_path / "effects.json").read_text())
    within = json.loads((tmp_path / "report.json").read_text())["effects_audit"]
    assert alone["needed"] == within["needed"]
    assert "payload" in alone["needed"]
    assert 'id="effects"' in (tmp_path / "report.html").read_text()
    assert main(["effects", *scene, "--tolerance", "0"]) == 2
    capsys.readouterr()


def test_where_nothing_was_tried_nothing_is_said_to_be_none():
    """Its bars were drawn on an axis without names, below "may be dropped: none"."""
    base = Measure(-1.0, 1e-9, "stable", np.array([5.0]), 0.01, 3, 100, 2.0)
    picture = draw_effects(Audit(base, (), (), 0.01, problem="not tried in the time: gravity off"))
    assert "may be dropped: not known" in picture.caption
    assert "none" not in picture.caption
    assert picture.svg == ""
