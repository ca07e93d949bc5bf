"""Every sentence of advice: a case that calls for it, and one that does not."""

from dataclasses import replace

import numpy as np
import pytest

import flexlin as fl
from flexlin.answers import Analysis, Loop
from flexlin.report import advise, caution, format_quantity, loop_line, record, render_page


def told(analysis: Analysis) -> str:
    return "\n".join(advise(analysis))


def growing(a: Analysis, rate: float, kind: str = "pd", error: float = 1e-16) -> Loop:
    """A loop whose growth rate is given."""
    found = a.own.floquet
    exponents = np.array([rate, -5.0, -6.0, -7.0], dtype=complex)
    verdict = "undecided" if abs(rate) <= error else "stable" if rate < 0 else "unstable"
    return Loop("scene's PD", kind, replace(found, exponents=exponents, errors=np.full(4, error), verdict=verdict))


def with_tip(a: Analysis, metres: float, share_of_bending: float = 1.0) -> Analysis:
    """The tip stays so far from its path, so much of it by bending."""
    tip = np.full_like(a.response.tip, metres / np.sqrt(2))
    return replace(a, response=replace(a.response, tip=tip, tip_by_bending=share_of_bending * tip))


def with_difference(a: Analysis, metres: float, largest: float, error: float = 1e-12) -> Analysis:
    """Nonlinear and linear tips differ by so much, while the tip deviates by `largest` and no coordinate by more."""
    s = a.simulation
    aside = np.zeros_like(s.tip_rigid)
    aside[:, 0] = largest
    linear = s.tip_rigid + aside * (1 - metres / largest)
    nonlinear = np.full_like(s.nonlinear, largest)
    made = replace(
        s, tip=s.tip_rigid + aside, tip_linear=linear, nonlinear=nonlinear, difference_error=error, peaks=None
    )
    return replace(a, simulation=made)


def with_control(a: Analysis, **changes: object) -> Analysis:
    return replace(a, scene=a.scene.model_copy(update={"control": a.scene.control.model_copy(update=changes)}))


def with_range(a: Analysis, amplitude: float) -> Analysis:
    return replace(a, linear_range=replace(a.linear_range, amplitudes=np.array([amplitude])))


def test_the_length_of_the_arm_is_that_of_its_links(single_link: Analysis) -> None:
    hub = single_link.scene.effects.hub.radius
    assert single_link.length == pytest.approx(0.96 + (hub[0] if isinstance(hub, tuple) else hub))
    three = fl.load_scene("three-link", {"designs": []})
    plant = fl.linearize(fl.build_manipulator(three), three.motion)
    blind = replace(single_link, plant=plant)
    assert blind.length == pytest.approx(sum(link.length for link in three.links))
    nowhere = replace(plant, about=replace(plant.about, arm=replace(plant.arm.near, points=None)))
    assert np.isnan(replace(single_link, plant=nowhere).length)


def test_what_is_fed_forward_already_is_no_advice(single_link: Analysis) -> None:
    a = with_tip(single_link, 0.05, share_of_bending=0.1)
    assert a.scene.control.feedforward == "rigid"
    assert "feed the rigid torque forward" not in told(a)
    assert "most of it the joints' error: raise the gains, or feed forward the elastic motion too" in told(a)
    none = with_control(a, feedforward="none")
    assert 'feed the rigid torque forward (control.feedforward = "rigid"), or raise the gains' in told(none)
    free = replace(none, own=replace(none.own, kind="open"))
    assert "or add feedback" in told(free)


def test_bending_is_named_where_it_is_most_of_the_error(single_link: Analysis) -> None:
    assert "most of it the links' bending" in told(with_tip(single_link, 0.05, 0.9))
    assert "most of it the links' bending" not in told(with_tip(single_link, 0.05, 0.1))


@pytest.mark.parametrize(("metres", "said"), [(567e-9, True), (9e-6, True), (2e-5, False), (0.05, False)])
def test_a_tip_error_of_no_account_asks_for_nothing(single_link: Analysis, metres: float, said: bool) -> None:
    text = told(with_tip(single_link, metres))
    assert ("nothing has to be done about it" in text) is said
    assert ("slow down" in text) is not said


@pytest.mark.parametrize(("metres", "said"), [(8.34, True), (0.25, True), (0.1, False)])
def test_a_deflection_that_is_not_small_is_no_prediction(single_link: Analysis, metres: float, said: bool) -> None:
    text = told(with_tip(single_link, metres))
    assert ("this is no prediction" in text) is said
    assert ("% of the arm's length" in text) is said


def test_a_difference_of_no_account_is_not_beyond_the_model(single_link: Analysis) -> None:
    """96 % of 5e-11 m."""
    text = told(with_difference(single_link, 4.8e-11, 5e-11, error=1e-15))
    assert "beyond the linear model" not in text
    assert "differ by no more than 0.048 nm: the linear model holds for this motion" in text
    text = told(with_difference(single_link, 0.048, 0.05))
    assert "96 % of the largest deviation: beyond the linear model" in text


def test_answers_that_agree_are_said_to(single_link: Analysis) -> None:
    text = told(with_difference(single_link, 1e-7, 0.05, error=1e-6))
    assert "agree to the error of the integration, 1×10⁻⁶ m: the linear model holds for this motion" in text
    assert "are the same: the linear" in told(with_difference(single_link, 0.0, 0.05, error=0.0))
    assert "agree to the error" not in told(with_difference(single_link, 1e-3, 0.05))
    assert "2 % of the largest deviation: the linear model holds for this motion" in told(
        with_difference(single_link, 1e-3, 0.05)
    )


def test_the_model_is_not_said_to_hold_beside_a_range_that_the_motion_leaves(single_link: Analysis) -> None:
    a = with_difference(single_link, 1e-4, 0.05)
    narrow, wide = told(with_range(a, 0.00041)), told(with_range(a, 0.1))
    assert "disturbances of up to 0.00041" in narrow
    assert "model holds" not in narrow
    assert "a disturbance as large as the motion's own deviation, 0.05 rad in q1, may leave it" in narrow
    assert "the linear model holds for this motion" in wide
    assert "may leave it" not in wide


PERIOD = 2.0


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (-0.4e-9, "practically marginal"),
        (0.4e-9, "practically marginal"),
        (-np.log(50) / 1.67e8, "but it takes 1.67×10⁸ s to settle"),
        (-1e-3, ""),
        (-2.0, ""),
        (1e-3, ""),
        (0.0, ""),
    ],
)
def test_a_decay_that_nobody_feels_is_called_so(single_link: Analysis, rate: float, words: str) -> None:
    assert single_link.plant.period == PERIOD
    a = replace(single_link, own=growing(single_link, rate))
    assert caution(a.own, PERIOD) == words
    assert words in loop_line(a.own, PERIOD)
    assert ("; a disturbance" in loop_line(a.own, PERIOD)) is bool(words)
    html = render_page(a, record(a), [], "").replace("\u00a0", " ")
    headline = html[html.index('<section class="verdict') :].split("</p>")[0]
    assert words in headline
    assert ('class="verdict undecided"' in headline) is bool(words or rate == 0.0)
    assert ("stable only in the mathematical sense" in told(a)) is bool(words and rate < 0)


def test_the_verdict_asks_for_what_it_calls_for(single_link: Analysis) -> None:
    assert "cannot be distinguished from zero" in told(replace(single_link, own=growing(single_link, 0.0)))
    assert "cannot be distinguished from zero" not in told(single_link)
    unstable = replace(single_link, own=growing(single_link, 1.0))
    assert "unstable along this motion under the scene's PD: change its gains" in told(unstable)
    assert "exists but is unstable" in told(unstable)
    bare = replace(single_link, own=growing(single_link, 1.0, kind="open"))
    assert "without feedback: add feedback" in told(bare)
    assert "exists but is unstable" not in told(single_link)
    helped = replace(unstable, designs=(Loop("lqr", "periodic-lqr", growing(single_link, -3.0).floquet),))
    assert "use the design “lqr”, which is stable" in told(helped)


def test_a_loop_without_verdict_is_not_called_unstable(single_link: Analysis) -> None:
    text = told(replace(single_link, own=Loop("scene's PD", "pd", None, "stopped")))
    assert "There is no verdict under the scene's PD: stopped." in text
    assert "unstable along this motion" not in text
    assert "There is no verdict" not in told(single_link)


def test_designs_are_weighed_against_the_loop_that_is_there(single_link: Analysis) -> None:
    rate = single_link.own.growth[0]

    def beside(*loops: Loop) -> str:
        return told(replace(single_link, designs=loops))

    fast, slow = (Loop("lqr", "periodic-lqr", growing(single_link, factor * rate).floquet) for factor in (2.0, 1.01))
    assert (
        "The design “lqr” is better than the scene's PD as far as is known: it settles 2 times as fast; tip error"
        in beside(fast)
    )
    assert "No design was found to be better than the scene's PD; tip error, peak torque" in beside(slow)
    assert "No design was found" not in beside(fast, slow)
    assert "settles" not in told(single_link)
    failed = Loop("lqr", "periodic-lqr", None, "it has no answer")
    assert "The design “lqr” has no answer: it has no answer." in beside(failed)
    assert "is unstable along this motion: do not use it" in beside(Loop("lqr", "x", growing(single_link, 1.0).floquet))


def test_a_design_that_is_faster_but_leads_the_tip_astray_is_called_a_trade(single_link: Analysis) -> None:
    """Faster by 1.08 with ten times the tip error; with a tenth of it, it is better; and where another is better all round, that one."""
    single_link = with_tip(single_link, 1e-3)
    own = single_link.response
    found = growing(single_link, 1.08 * single_link.own.growth[0]).floquet

    def design(name: str, factor: float) -> Loop:
        return Loop(name, "pd", found, response=replace(own, tip=factor * own.tip))

    tips = [format_quantity(factor * float(own.tip_error.max()), "m") for factor in (1.0, 10.0, 0.1)]
    text = told(replace(single_link, designs=(design("lqr", 10.0),)))
    assert "“lqr” is a trade against the scene's PD: it settles 1.08 times as fast, but" in text
    assert f"its tip error is {tips[1]} instead of {tips[0]}" in text
    text = told(replace(single_link, designs=(design("lqr", 10.0), design("good", 0.1))))
    assert "“good” is better than the scene's PD" in text
    assert f"its tip error is {tips[2]} instead of {tips[0]}" in text


def test_the_elastic_motion_is_believed_where_it_changes_the_verdict(single_link: Analysis) -> None:
    same, other = (growing(single_link, rate, "elastic") for rate in (-2.0, 0.5))
    assert "the verdict stands" in told(replace(single_link, elastic=same))
    assert "the verdict becomes unstable: believe this one" in told(replace(single_link, elastic=other))
    assert "elastic motion instead" not in told(single_link)
    assert "elastic motion instead" not in told(replace(single_link, elastic=Loop("e", "elastic", None, "none")))


def test_what_is_missing_is_said(single_link: Analysis) -> None:
    problems = {"response": "resonant", "simulation": "it diverges"}
    gone = told(replace(single_link, response=None, simulation=None, problems=problems))
    assert "No periodic response was found: resonant." in gone
    assert "The nonlinear simulation has no answer: it diverges." in gone
    assert "no answer" not in told(single_link)
    assert "disturbances of up to" in gone
