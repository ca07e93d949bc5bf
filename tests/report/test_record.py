"""report.json says what the library says, and survives numbers that JSON cannot hold; what each loop endures; the audit of effects as
picture, data and lines."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Analysis, Audit, Measure, Row, analyse, find_loop_margins
from flexlin.cli import main
from flexlin.periodic import Margins
from flexlin.report import audit_block, audit_lines, describe_endured, draw_effects, record, record_endured, to_json
from tests.closed_arm import control_loop
from tests.test_limits import raising


def test_the_record_holds_what_the_library_computes(single_link: Analysis) -> None:
    data = json.loads(to_json(record(single_link)))
    expected = fl.floquet(control_loop(single_link.scene))
    block = data["floquet"]
    exponents = np.array(block["exponents"]) @ [1, 1j]
    assert data["schema"] == 1
    assert block["verdict"] == expected.verdict == "stable"
    assert np.all(np.abs(exponents - expected.exponents) <= expected.error + block["error"])
    multipliers = np.array(block["multipliers"]) @ [1, 1j]
    assert np.allclose(multipliers, np.exp(exponents * data["period"]), rtol=1e-9, atol=1e-300)
    assert data["open_loop"]["verdict"] == "unstable"
    assert data["effects"]["on"] == ["gravity", "payload", "hub", "geometric_stiffening", "modal_damping"]
    assert [step["name"] for step in data["steps"]] == [step.name for step in single_link.steps]
    assert sum(step["seconds"] for step in data["steps"]) > 0.01  # the clock ran, and in seconds


def test_numbers_beyond_floating_point_become_null_and_keep_their_logs(single_link: Analysis) -> None:
    found = single_link.own.floquet
    far = replace(found, exponents=np.array([1e4 + 1j, -1e4 + 0j, -1.0 + 0j]), errors=np.full(3, 1e-9))
    block = json.loads(to_json(record(replace(single_link, own=replace(single_link.own, floquet=far)))["floquet"]))
    period = found.period
    overflown, vanished, ordinary = block["multipliers"]
    assert overflown[0] is None  # exp(2e4): a number that JSON cannot hold, nor a float
    assert (vanished, ordinary) == ([0.0, 0.0], [pytest.approx(np.exp(-period), rel=1e-12), 0.0])
    logs = np.array(block["log_multipliers"])
    assert logs[:, 0] == pytest.approx([1e4 * period, -1e4 * period, -period], rel=1e-12)


def test_margins_in_words_and_as_data():
    """A margin that is unknown is not said to be without limit."""
    errors, reason = (0.0, 0.0, 1e-7, 1e-9), "tol 1e-7 needs too many segments"
    known = Margins((0.0, math.inf), math.radians(47.96), 0.00244, errors)
    unknown = replace(known, gain=(0.1, math.inf), phase=math.pi / 3, delay=math.nan, reason=reason)
    said = ["gain 0 to ∞, phase 48°, delay 2.44 ms", "gain 0.1 to ∞, phase 60°, delay unknown", "–"]
    assert [describe_endured(one) for one in (known, unknown, None)] == said
    record, lacking = (json.loads(to_json(record_endured(one))) for one in (known, unknown))
    assert record == {"gain": [0.0, None], "phase": known.phase, "delay": known.delay, "errors": [*errors]}
    assert (lacking["reason"], lacking["delay"]) == (reason, None)


@pytest.mark.slow
def test_the_own_loop_of_an_arm_has_margins_and_the_open_one_has_none():
    scene = fl.load_scene("single-link", {"links.0.modes": 0}).model_copy(update={"designs": ()})
    a = analyse(scene)
    find_loop_margins(a)
    assert list(a.endured) == [a.own.name]
    own = a.endured[a.own.name]
    late = fl.control.sampled_floquet(a.plant.periodic_system(), a.closed.law.gain, own.delay / 100, own.delay / 200)
    assert late.verdict == "stable"
    assert 0 < own.phase < math.pi
    assert own.gain[0] < 1 < own.gain[1]


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
    assert [picture.svg.count(f"fill:var(--{colour})") for colour in ("blue", "orange")] == [2, 1]
    assert "needed: gravity, payload" in picture.caption


def test_the_data_survive_what_json_cannot_hold(audited: Audit) -> None:
    data = json.loads(to_json(audit_block(audited)))
    assert (data["needed"], data["droppable"]) == (["gravity", "payload"], ["hub"])
    assert [entry["significance"] for entry in data["rows"]] == [None, 0.5, 0.02, 0.0, None]


def test_the_lines_are_sorted_and_tell_the_problem(audited: Audit) -> None:
    lines = audit_lines(audited)
    assert [line.split()[1] for line in lines[1:6]] == ["gravity", "payload", "motor", "hub", "shear"]
    assert "it cannot be judged" in lines[5]
    assert lines[6].startswith("the scene: stable, −1 ± 1×10⁻⁹ 1/s")
    on = ["effects of the scene, with its figures", "  gravity: none", "  payload: none", "  hub: none"]
    assert lines[7:] == [*on, "effects that are off were tried with", "  motor: gear_ratio 2", "  shear: none"]


@pytest.mark.slow
def test_the_command_and_the_report_agree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = ["single-link", "--set", "links.0.modes=0", "designs=[]", "--out", str(tmp_path)]
    assert main(["effects", *scene]) == 0
    assert main(["report", *scene, "--effects"]) == 0
    alone = json.loads((tmp_path / "effects.json").read_text())
    within = json.loads((tmp_path / "report.json").read_text())["effects_audit"]
    assert alone["needed"] == within["needed"]
    assert "payload" in alone["needed"]
    assert 'id="effects"' in (tmp_path / "report.html").read_text()
    assert main(["effects", *scene, "--tolerance", "0"]) == 2
    monkeypatch.setattr("flexlin.audit", raising(fl.errors.TimeLimit("late")))
    assert main(["report", *scene, "--effects"]) == 4


def test_where_nothing_was_tried_nothing_is_said_to_be_none():
    """Its bars were drawn on an axis without names, below "may be dropped: none"."""
    base = Measure(-1.0, 1e-9, "stable", np.array([5.0]), 0.01, 3, 100, 2.0)
    picture = draw_effects(Audit(base, (), (), 0.01, problem="not tried in the time: gravity off"))
    assert "may be dropped: not known" in picture.caption
    assert "none" not in picture.caption
    assert picture.svg == ""
