"""A verdict is worth what the linear model behind it is worth: words, colours and exit codes where that does not hold."""

import re
from dataclasses import replace
from math import inf

import pytest

from flexlin.analyses import Analysis, Loop, judge_model
from flexlin.cli import meets
from flexlin.errors import SimulationStopped
from flexlin.report import advise, record, render_page
from flexlin.report.wording import reason
from flexlin.simulation.result import OUTGROWN
from tests.report.test_advice import with_tip

FEEBLE = "control.feedback={kind='pd', kp=[0.5], kd=[0.01]}"
BROKEN = ["motion.frequency=0.9", "effects.payload.mass=2", FEEBLE, "designs=[]"]


@pytest.mark.slow
def test_a_meaningless_result_is_not_green(report) -> None:
    """The linear answer takes the tip 0.97 m off on an arm of 0.96 m, and more than that round it."""
    ran = report("single-link", "--set", *BROKEN, "--tol", "1e-6", "--require", "stable")
    assert ran.code == 3
    assert "stable, but the linear model does not hold here" in ran.out
    assert (ran.data["floquet"]["verdict"], ran.data["validity"]["verdict"]) == ("stable", "invalid")
    tip = next(figure for figure in ran.data["validity"]["figures"] if figure["what"] == "tip")
    assert (tip["value"], tip["bound"]) == (pytest.approx(0.968, abs=0.001), pytest.approx(0.192))
    assert tip["value"] == ran.data["forced_response"]["largest_tip_error"]
    headline = ran.page[ran.page.index('<section class="verdict') :].split("</p>")[0]
    assert headline.startswith('<section class="verdict undecided">')
    assert "Stable, but the linear model does not hold here" in headline
    assert re.search(r"0\.968\sm, 101\s% of the arm(?:'|&#39;)s length", headline)
    assert "0.968 m" in ran.out


ASKED = [
    ("stable", "stable", "invalid", False),
    ("stable", "stable", "unknown", True),
    ("valid", "stable", "unknown", False),
    ("valid", "unstable", "valid", False),
    ("linear-stable", "stable", "invalid", True),
    ("linear-stable", "undecided", "valid", False),
    (None, "unstable", "invalid", True),
]


@pytest.mark.parametrize(("required", "verdict", "model", "met"), ASKED)
def test_what_each_requirement_asks(required: str | None, verdict: str, model: str, met: bool) -> None:
    assert meets(required, verdict, model) is met


def test_an_answer_that_grows_without_bound_has_no_share() -> None:
    assert reason(judge_model(1.0, simulated=(inf, 1.0, 0.0, "m"))) == OUTGROWN


def test_a_model_that_holds_is_said_to(single_link: Analysis) -> None:
    data = record(single_link)
    assert (data["validity"]["verdict"], data["validity"]["reason"]) == ("valid", "")
    assert not any(figure["against"] for figure in data["validity"]["figures"])
    assert "does not hold" not in render_page(single_link, data, [], "") + "".join(advise(single_link))


def test_bending_breaks_the_equations_themselves_and_joints_do_not() -> None:
    """A simulation of beams of small bending confirms no large one, that of curves does; both confirm joints that are far off."""
    agreed = (0.001, 0.5, 1e-9, "m")
    assert judge_model(1.0, (0.5, 0.5), agreed).verdict == "invalid"
    assert judge_model(1.0, (0.5, 0.5), agreed, curved=True).verdict == "valid"
    assert judge_model(1.0, (0.5, 0.5), (0.2, 0.5, 1e-9, "m"), curved=True).verdict == "invalid"
    assert judge_model(1.0, (0.5, 0.5), curved=True).verdict == "invalid"
    assert judge_model(1.0, (0.05, 0.5), agreed).verdict == "valid"
    assert judge_model(1.0, (0.05, 0.5), (0.001, 0.1, 1e-9, "m")).verdict == "invalid"  # it came a fifth as far
    assert judge_model(1.0, (0.05, 0.5)).verdict == "invalid"
    assert judge_model(1.0, (0.05, 0.1)).verdict == "unknown"
    assert judge_model(1.0, (0.05, 1e-3), (4e-4, 1e-3, 1e-9, "m")).verdict == "valid"  # a feedforward leads the tip
    assert judge_model(float("nan"), (float("nan"), float("nan"))).verdict == "unknown"


def test_two_answers_apart_speak_against_the_model_where_it_matters() -> None:
    assert judge_model(1.0, None, (0.03, 0.1, 1e-9, "m")).verdict == "invalid"
    assert judge_model(1.0, None, (0.01, 0.1, 1e-9, "m")).verdict == "valid"
    assert judge_model(1.0, None, (5e-6, 5e-6, 1e-9, "m")).verdict == "valid"  # no arm repeats so well
    assert judge_model(1.0, None, (0.03, 0.1, 0.04, "m")).verdict == "valid"  # the error of the integration is larger
    assert judge_model(float("nan"), None, (0.3, 1.0, 1e-9, "rad")).verdict == "invalid"
    assert judge_model(1.0, None, None, (0.1, 3.0)).verdict == "invalid"
    assert judge_model(1.0).verdict == "unknown"


@pytest.mark.parametrize(("left", "verdict"), [(True, "invalid"), (False, "unknown")])
def test_an_end_of_the_simulation_counts_where_the_arm_left_the_equations(single_link, left, verdict) -> None:
    end = SimulationStopped("the nonlinear simulation stopped at t = 0.1 s", t=0.1, left_range=left)
    a = replace(single_link, simulation=None, stopped=end, problems={"simulation": str(end)})
    assert a.validity(a.own).verdict == verdict
    assert ("lose their meaning after 100 ms" in "".join(advise(a))) is left


def test_a_design_is_judged_by_its_own_steady_motion(single_link: Analysis) -> None:
    own = single_link.own
    far, near = (with_tip(single_link, metres).response for metres in (0.5, 0.01))
    loops = (Loop(name, "pd", own.floquet, response=found) for name, found in (("far", far), ("near", near)))
    a = replace(single_link, designs=tuple(loops))
    data, said = record(a), "\n".join(advise(a))
    assert [data["designs"][name]["validity"]["verdict"] for name in ("far", "near")] == ["invalid", "unknown"]
    assert "The design “far” is stable, but the linear model does not hold under it" in said
    assert "The design “near” is stable, but" not in said
    page = render_page(a, data, [], "")
    rows = {name: page[page.index(f"<td>{name}</td>") :].split("</tr>")[0] for name in ("far", "near")}
    assert 'class="undecided">stable<br>but the linear model does not hold here' in rows["far"]
    assert "500\u00a0mm" in rows["far"]
    assert 'class="stable">stable</td>' in rows["near"]
    assert "10\u00a0mm" in rows["near"]


def test_an_unstable_loop_is_recommended_no_design_that_the_model_does_not_hold_for(single_link: Analysis) -> None:
    own = single_link.own.floquet
    unstable = replace(single_link.own, floquet=replace(own, exponents=own.exponents + 10.0, verdict="unstable"))
    far = Loop("far", "periodic-lqr", own, response=with_tip(single_link, 0.5).response)
    for design, said in ((far, False), (replace(far, response=None), True)):
        advice = advise(replace(single_link, own=unstable, designs=(design,)))
        assert ("use the design “far”" in "\n".join(advice)) is said


def test_answers_that_agree_on_a_large_bending_are_not_praised(single_link: Analysis) -> None:
    said = "\n".join(advise(with_tip(single_link, 0.5)))
    assert "the linear model holds" not in said
    assert "both rest on equations of small deflections, and these are large" in said
    assert "both rest on equations" not in "\n".join(advise(single_link))
