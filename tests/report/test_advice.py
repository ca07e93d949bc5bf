"""Every sentence of advice: a case that calls for it, and one that does not; where the verdict changes."""

import re
from dataclasses import replace

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Analysis, CriticalValue, Loop, Margin, analyse, choose_margins, find_margin
from flexlin.report import advise, describe_margins, format_quantity, loop_line, record, record_margin, render_page


def told(analysis: Analysis) -> str:
    return "\n".join(advise(analysis))


def page_of(a, *pictures):
    return render_page(a, record(a), list(pictures), "flexlin report single-link")


def growing(a: Analysis, rate: float, kind: str = "pd", error: float = 1e-16) -> Loop:
    """A loop whose growth rate is given."""
    found = a.own.floquet
    exponents = np.array([rate, -5.0, -6.0, -7.0], dtype=complex)
    verdict = "undecided" if abs(rate) <= error else "stable" if rate < 0 else "unstable"
    result = replace(found, exponents=exponents, errors=np.full(4, error), verdict=verdict)
    return Loop("scene's PD", kind, result, response=a.own.response)


def unjudged(a: Analysis) -> Loop:
    """The loop without a verdict."""
    return replace(a.own, name="my PD", floquet=None, problem="ended")


def with_response(a: Analysis, response) -> Analysis:
    return replace(a, own=replace(a.own, response=response))


def with_tip(a: Analysis, metres: float, share_of_bending: float = 1.0) -> Analysis:
    """The tip stays so far from its path, so much of it by bending, and none where the motion is slow."""
    tip = np.full_like(a.response.tip, metres / np.sqrt(2))
    return with_response(a, replace(a.response, tip=tip, tip_by_bending=share_of_bending * tip, at_rest=0.0))


def with_difference(a: Analysis, metres: float, largest: float, error: float = 1e-12) -> Analysis:
    """Nonlinear and linear tips differ by so much, while the tip deviates by `largest` and no coordinate by more."""
    s = a.simulation
    aside = np.zeros_like(s.tip_rigid)
    aside[:, 0] = largest
    linear = s.tip_rigid + aside * (1 - metres / largest)
    nonlinear = np.full_like(s.nonlinear, largest)
    made = {"tip": s.tip_rigid + aside, "tip_linear": linear, "nonlinear": nonlinear}
    return replace(a, simulation=replace(s, **made, difference_error=error, peaks=None))


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
    assert 'raise the gains, or feed forward the elastic motion too (control.feedforward = "tip-exact")' in told(a)
    bare = a.scene.control.model_copy(update={"feedforward": "none"})
    none = replace(a, scene=a.scene.model_copy(update={"control": bare}))
    assert 'feed the rigid torque forward (control.feedforward = "rigid"), or raise the gains' in told(none)
    assert "or add feedback" in told(replace(none, own=replace(none.own, kind="open")))


HOLDS = "the linear model holds for this motion"
CASES = [
    (lambda a: with_tip(a, 0.05, 0.9), "most of it the links' bending", True),
    (lambda a: with_tip(a, 0.05, 0.1), "most of it the links' bending", False),
    # a tip error of no account asks for nothing
    (lambda a: with_tip(a, 9e-6), "nothing has to be done about it", True),
    (lambda a: with_tip(a, 2e-5), "slow down", True),
    # a deflection that is not small is no prediction
    (lambda a: with_tip(a, 0.25), "this is no prediction", True),
    (lambda _: analyse(fl.load_scene("khang-2019")), "of the arm; stiffen the links or lower the payload.", True),
    # gravity makes most of the single link's, which no slower motion removes; of one without gravity it does
    (lambda a: a, "joint feedback removes: feed", True),
    (lambda a: with_tip(a, 0.1), "this is no prediction", False),
    # 96 % of 5e-11 m is not beyond the model, of 0.1 m it is
    (lambda a: with_difference(a, 4.8e-11, 5e-11, error=1e-15), "beyond the linear model", False),
    (lambda a: with_difference(a, 4.8e-11, 5e-11, error=1e-15), f"differ by no more than 0.048 nm: {HOLDS}", True),
    (lambda a: with_difference(a, 0.096, 0.1), "96 % of the largest deviation: beyond the linear model", True),
    (lambda a: with_difference(a, 1e-7, 0.05, error=1e-6), f"the error of the integration, 1×10⁻⁶ m: {HOLDS}", True),
    (lambda a: with_difference(a, 0.0, 0.05, error=0.0), "are the same: the linear", True),
    # a difference far below an atom's size, though above an error of nearly nothing, is rounding
    (lambda a: with_difference(a, 5.6e-17, 0.05, error=1e-17), f"tips are the same: {HOLDS}", True),
    (lambda a: with_difference(a, 1e-3, 0.05), f"% of the links' bending: {HOLDS}", True),
    # a simulation that is far from itself judges nothing
    (lambda a: replace(a, simulation=replace(a.simulation, error=1.1)), "judges no linear model", True),
    # gains of motors remove no give of joints
    (lambda _: analyse(fl.load_scene("flexible-joint-link")), "no motor's feedback removes: slow down", True),
    # the elastic motion is believed where it changes the verdict
    (lambda a: replace(a, elastic=growing(a, -2.0, "elastic")), "the verdict stands", True),
    (lambda a: replace(a, elastic=growing(a, 0.5, "elastic")), "verdict becomes unstable: believe this one", True),
    (lambda a: replace(a, elastic=Loop("e", "elastic", None, "none")), "elastic motion instead", False),
    # what is missing is said
    (lambda a: replace(with_response(a, None), problems={"response": "resonant"}), "was found: resonant.", True),
    (lambda a: replace(a, simulation=None, problems={"simulation": "lost"}), "simulation has no answer: lost.", True),
    (lambda a: replace(a, simulation=None, problems={"simulation": "lost"}), "disturbances of up to", True),
    # a loop without verdict is not called unstable
    (lambda a: replace(a, own=unjudged(a)), "There is no verdict under the my PD: ended.", True),
    (lambda a: replace(a, own=unjudged(a)), "unstable along this motion", False),
    (lambda a: replace(a, own=growing(a, 0.0)), "cannot be distinguished from zero", True),
]


@pytest.mark.parametrize("case", range(len(CASES)))
def test_a_sentence_is_said_where_it_is_called_for(single_link: Analysis, case: int) -> None:
    change, words, said = CASES[case]
    assert (words in told(change(single_link))) is said, words
    assert not re.search("motion instead|no answer|no verdict|distinguished from zero|is unstable", told(single_link))


def test_the_model_is_not_said_to_hold_beside_a_range_that_the_motion_leaves(single_link: Analysis) -> None:
    a = with_difference(single_link, 1e-4, 0.05)
    ranges = (replace(a.linear_range, amplitudes=np.array([amplitude])) for amplitude in (0.00041, 0.1))
    narrow, wide = (told(replace(a, linear_range=one)) for one in ranges)
    assert "disturbances of up to 0.00041" in narrow
    assert "model holds" not in narrow
    assert "a disturbance as large as the motion's own deviation, 0.05 rad in q1, may leave it" in narrow
    assert "the linear model holds for this motion" in wide
    assert "may leave it" not in wide


DECAYS = [
    (-0.4e-9, "practically marginal"),
    (0.4e-9, "practically marginal"),
    (-np.log(50) / 1.67e8, "but it takes 1.67×10⁸ s to settle"),
    (-1e-3, ""),
    (0.0, ""),
]


@pytest.mark.parametrize(("rate", "words"), DECAYS)
def test_a_decay_that_nobody_feels_is_called_so(single_link: Analysis, rate: float, words: str) -> None:
    a = replace(single_link, own=growing(single_link, rate))
    weak = re.match(r"  scene's PD +\w+, (.*); a disturbance", loop_line(a.own, a.plant.period, a.validity(a.own)))
    assert (weak[1] if weak else "") == words
    html = page_of(a).replace("\u00a0", " ")
    headline = html[html.index('<section class="verdict') :].split("</p>")[0]
    assert words in headline
    assert ('class="verdict undecided"' in headline) is bool(words or rate == 0.0)
    assert ("stable only in the mathematical sense" in told(a)) is bool(words and rate < 0)


def test_an_unstable_arm_is_shown_a_way_out(single_link: Analysis) -> None:
    unstable = replace(single_link, own=growing(single_link, 1.0))
    assert "unstable along this motion under the scene's PD: change its gains" in told(unstable)
    assert "exists but is unstable" in told(unstable)
    bare = replace(single_link, own=growing(single_link, 1.0, kind="open"))
    assert "without feedback: add feedback" in told(bare)
    helped = replace(unstable, designs=(Loop("lqr", "periodic-lqr", growing(single_link, -3.0).floquet),))
    assert "use the design “lqr”, which is stable" in told(helped)


def test_designs_are_weighed_against_the_loop_that_is_there(single_link: Analysis) -> None:
    rate = single_link.own.growth[0]

    def beside(*loops: Loop) -> str:
        return told(replace(single_link, designs=loops))

    fast, slow = (Loop("lqr", "periodic-lqr", growing(single_link, factor * rate).floquet) for factor in (2.0, 1.01))
    better = "“lqr” is better than the scene's PD as far as is known: it settles 2 times as fast; tip error"
    assert better in beside(fast)
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


@pytest.mark.slow
def test_margins_say_where_the_verdict_changes_and_where_it_does_not():
    scene = fl.load_scene("khang-2019")
    chosen = {"motion.frequency": (0.5, 3.0), "parameters.payload_mass": (0.05, 0.2)}
    margins = tuple(find_margin(scene, path, limits) for path, limits in chosen.items())
    kept = "keeps its verdict for a payload mass from 0.05 to 0.2 kg"
    assert describe_margins(scene, margins) == f"becomes unstable at a motion frequency of 2.476 Hz (now 0.5); {kept}"
    (critical,) = record_margin(margins[0])["critical"]
    assert (critical["kind"], critical["value"]) == ("onset", pytest.approx(2.4760282, abs=1e-6))
    assert choose_margins(scene) == {"motion.frequency": (0.125, 4.0), "parameters.payload_mass": (0.025, 0.8)}


def test_a_search_that_had_to_end_says_where_a_change_may_hide():
    scene = fl.load_scene("single-link")
    path, limits = "motion.frequency", (0.125, 4.0)
    onset = CriticalValue(path, 2.5, 0.25, "onset", "not looked for", 2.0, np.nan)
    margin = Margin(path, *limits, 0.5, 9, (), 0.501, (0.4, 0.9))
    left = "shows the same verdict at the 9 values of motion frequency from 0.125 to 4 Hz that time allowed, "
    left += "which leave gaps of up to 0.501 Hz"
    todo = "ask for a narrower range (--margins) or more time (--limit-seconds)"
    assert describe_margins(scene, (margin,)) == f"{left}, but none from 0.4 to 0.9; {todo}"
    assert describe_margins(scene, (replace(margin, searched=(0.6, 0.4)),)) == f"{left}; {todo}"
    none = "was not searched to the end over motion frequency, of which nothing more is said"
    assert describe_margins(scene, (replace(margin, values=2, gap=3.875),)) == f"{none}; {todo}"
    said = describe_margins(scene, (replace(margin, high=2.6, critical=(onset,)),))
    known = "becomes unstable at a motion frequency between 2.25 and 2.6 Hz (now 0.5)"
    assert said.startswith(f"{known}; shows no other change")
    record = record_margin(replace(margin, critical=(onset,)))
    assert (record["gap"], record["critical"][0]["error"]) == (0.501, 0.25)
