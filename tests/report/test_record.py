"""report.json says what the library says, and survives numbers that JSON cannot hold; what each loop endures."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Analysis, Clock, Loop, analyse, find_loop_margins
from flexlin.periodic import Margins
from flexlin.report import describe_endured, record, record_endured, record_loop, to_json
from tests.closed_arm import control_loop


def test_the_record_holds_what_the_library_computes(single_link: Analysis) -> None:
    data = json.loads(to_json(record(single_link)))
    scene = single_link.scene
    expected = fl.floquet(control_loop(scene).periodic_system())
    block = data["floquet"]
    exponents = np.array(block["exponents"]) @ [1, 1j]
    assert data["schema"] == 1
    assert block["verdict"] == expected.verdict == "stable"
    assert np.all(np.abs(exponents - expected.exponents) <= expected.error + block["error"])
    multipliers = np.array(block["multipliers"]) @ [1, 1j]
    assert np.allclose(multipliers, np.exp(exponents * data["period"]), rtol=1e-9, atol=1e-300)
    assert data["open_loop"]["verdict"] == "unstable"
    assert data["effects"]["on"] == ["gravity", "payload", "hub", "geometric_stiffening", "modal_damping"]
    assert data["scene"]["effects"]["payload"]["mass"] == scene.effects.payload.mass
    assert [step["name"] for step in data["steps"]] == [step.name for step in single_link.steps]
    assert sum(step["seconds"] for step in data["steps"]) > 0.01  # the clock ran, and in seconds


def test_numbers_beyond_floating_point_become_null_and_keep_their_logs(single_link: Analysis) -> None:
    found = single_link.own.floquet
    far = replace(found, exponents=np.array([1e4 + 1j, -1e4 + 0j, -1.0 + 0j]), errors=np.full(3, 1e-9))
    block = record_loop(Loop("far", "pd", far))
    text = to_json(block)
    period = found.period
    overflown, vanished, ordinary = json.loads(text)["multipliers"]
    assert overflown[0] is None  # exp(2e4): a number that JSON cannot hold, nor a float
    assert vanished == [0.0, 0.0]
    assert ordinary == [pytest.approx(np.exp(-period), rel=1e-12), 0.0]
    logs = np.array(json.loads(text)["log_multipliers"])
    assert logs[:, 0] == pytest.approx([1e4 * period, -1e4 * period, -period], rel=1e-12)


def test_numbers_keep_every_digit() -> None:
    values = np.array([[1 / 3, np.pi], [1e-300, -0.1]])
    assert np.array_equal(np.array(json.loads(to_json({"values": values}))["values"]), values)


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
    a = analyse(scene, Clock())
    find_loop_margins(a)
    assert list(a.endured) == [a.own.name]
    own = a.endured[a.own.name]
    late = fl.control.sampled_floquet(a.plant.periodic_system(), a.closed.law.gain, own.delay / 100, own.delay / 200)
    assert late.verdict == "stable"
    assert 0 < own.phase < math.pi
    assert own.gain[0] < 1 < own.gain[1]
