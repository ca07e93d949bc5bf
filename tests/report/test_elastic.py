"""The report about the elastic motion: one more loop, and by how much the verdict moves."""

import pytest

import flexlin as fl
from flexlin.answers import analyse
from flexlin.report import advise, record


@pytest.mark.slow
def test_the_elastic_motion_is_judged_beside_the_rigid_one():
    scene = fl.load_scene(
        "single-link", {"links.0.modes": 1, "designs": [], "control.about": "elastic", "accuracy.tol": 1e-6}
    )
    found = analyse(scene)
    assert [loop.kind for loop in found.loops] == ["open", "pd", "elastic"]
    assert found.elastic.verdict == found.own.verdict == "stable"
    assert found.elastic.growth[0] == pytest.approx(found.own.growth[0], rel=0.3)
    assert found.elastic.growth[0] != found.own.growth[0]
    assert any("elastic motion" in said and "verdict stands" in said for said in advise(found))
    assert record(found)["elastic_motion"]["verdict"] == "stable"


def test_the_report_says_how_far_the_linear_equations_hold(single_link):
    assert single_link.linear_range.amplitudes.min() > 0
    block = record(single_link)["linear_range"]
    assert block["share"] == 0.1
    assert any("disturbances of up to" in said for said in advise(single_link))
