"""What each loop endures: found for loops with a feedback on the arm's states, said beside them, kept as data."""

import json
import math

import pytest

import flexlin as fl
from flexlin.answers import Clock, analyse, find_loop_margins
from flexlin.periodic import Margins
from flexlin.report import describe_endured, record_endured, to_json


def test_margins_in_words_and_as_data():
    found = Margins((0.0, math.inf), math.radians(47.96), 0.00244, (0.0, 0.0, 1e-7, 1e-9))
    assert describe_endured(found) == "gain 0 to ∞, phase 48°, delay 2.44 ms"
    assert describe_endured(None) == "–"
    assert json.loads(to_json(record_endured(found))) == {
        "gain": [0.0, None], "phase": math.radians(47.96), "delay": 0.00244, "errors": [0.0, 0.0, 1e-7, 1e-9],
    }  # fmt: skip


def test_a_margin_that_is_unknown_is_not_said_to_be_without_limit():
    found = Margins(
        (0.1, math.inf), math.pi / 3, math.nan, (1e-9, 0.0, 1e-7, math.nan), "tol 1e-7 needs too many segments"
    )
    assert describe_endured(found) == "gain 0.1 to ∞, phase 60°, delay unknown"
    record = json.loads(to_json(record_endured(found)))
    assert (record["reason"], record["delay"]) == (found.reason, None)


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
