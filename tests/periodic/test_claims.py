"""A fixed sample of the jury: each claimed error covers the true one, and no verdict is wrong; and the judge catches a liar.

The whole jury is heard by `studies/own_error.py`. FOUND holds cases on which an engine has failed, or taken a minute to refuse.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import flexlin as fl
from tests.periodic.chains import Real
from tests.periodic.judge import judged
from tests.periodic.jumping_systems import reference_jump, reference_pulse
from tests.periodic.non_normal_systems import reference_non_normal
from tests.periodic.random_systems import COUNTS, draw
from tests.periodic.systems import oscillator
from tests.periodic.truths import eigenvalues, integrated, panels_of
from tests.thinned import thin

FOUND = {
    "non-normal switched": (28,),
    "pulses": (26, 74, 113, 9909000648),
    "jumps not named": (39, 35, 9),
    "jumps not named, smooth between": (47, 9),
    "Meissner not named": (20, 15),
    "jumps named": (17,),
    "kinks not named": (59,),
    "rotation": (143,),
    "exponential": (167,),
    "non-normal constant": (18, 996400142),
    "non-normal, f(t) C": (18, 13),
    "multipliers 1e-300 to 1e300": (7707000584,),
    "kept shapes": (13, 777000016, 251123000079),
    "waving shapes": (616162027, 616164793),
    # 88002000054: segments of an L-stable method were held to lose what others would: a mode that grows by 0.5 1/s counted as hidden
    "stiff": (991000006, 991000017, 88002000054),
    # three equal multipliers are split three times as far as they move: claims of what better factors change alone were missed
    "jordan": (77004000014, 77004000067),
}
FIXED = {"fixed settings": (108, 83, 115, 991000117, 7707000084, *range(9))}
"""Method, order and segments are held: claims hold, or are refused. Two have stages that are singular, as the last bit decides."""
BOUNDED = {
    "kept shapes": (910000030, 910000006),
    "waving shapes": (910000056,),
    "non-normal constant": (910000058,),
    "undamped oscillators": (910000036,),
    "non-normal rotated": (910000020,),
    "rotation": (910000019,),
    "shear": (910000012,),
    "jordan": (910000014, 910000064),
}
"""Cases in which Radau's method hid a mode that was known, since it lay near the slowest one."""
MUST_ANSWER = {"rotation", "shear", "exponential", "mixed", "reparametrised", "kinks named"}
MUST_ANSWER |= {"jumps named", "Mathieu", "Krein"}
"""Kinds in which nothing is hidden from the engine: it has no reason to refuse."""


def listed(seeds):
    return [(kind, seed) for kind, some in seeds.items() for seed in some]


def check(outcome):
    assert not outcome.crash
    assert not outcome.wrong
    assert outcome.worst <= 1


@pytest.mark.parametrize(("kind", "seed"), thin(listed(BOUNDED), 6))
def test_claims_hold_where_fast_modes_are_only_bounded(kind, seed):
    case = draw(kind, seed)
    check(judged(replace(case, options={**case.options, "method": "radau"})))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [(kind, 5_000_000) for kind in COUNTS] + listed(FOUND | FIXED))
def test_claims_hold(kind, seed):
    outcome = judged(draw(kind, seed))
    check(outcome)
    assert not (outcome.refusal and kind in MUST_ANSWER)


SURE = ("rotation", "shear", "mixed", "multipliers 1e-300 to 1e300", "reparametrised")


@pytest.mark.slow
@pytest.mark.parametrize(
    "kinds", [SURE, ("kinks not named",), ("pulses",), ("jumps not named, smooth between",)], ids=lambda kinds: kinds[0]
)
def test_claims_do_not_exaggerate(kinds):
    """Some 1e4 times the true error when the place of each jump counted as uncertain, and every panel as no better than was asked."""
    seeds, asked = (range(2), {}) if kinds == SURE else (range(6, 16), {"tol": 1e-9})
    outcomes = [judged(replace(draw(kind, seed), **asked)) for kind in kinds for seed in seeds]
    ratios = [ratio for one in outcomes for ratio in one.overestimates]
    assert len(ratios) > (30 if kinds == SURE else 10)
    assert np.median(ratios) < 30
    assert kinds != SURE or np.mean([one.reached for one in outcomes]) > 0.8  # tol, in all exponents


@pytest.mark.parametrize("tol", [1e-9, 1e-4])
def test_a_kink_that_nobody_named_is_claimed_as_well_as_it_is_known(tol):
    """x' = (0.3 - 2 |sin(pi t / T - 1)|) x: the exponent is the mean."""
    T, start = 3.0, 1.0
    system = fl.PeriodicSystem(lambda t: (0.3 - 2 * np.abs(np.sin(np.pi * t / T - start)))[:, None, None], T)
    found = fl.floquet(system, tol)
    assert abs(found.exponents[0] - (0.3 - 4 / np.pi)) <= found.errors[0] + 2e-16
    assert found.errors[0] < 1e-14


def test_a_narrow_pulse_is_answered_when_its_place_is_named():
    """With breaks around it the pulse is an interval of its own: there is no reason to refuse."""
    outcome = judged(replace(reference_pulse(), breaks=(0.0, 0.3 - 2e-3, 0.3, 0.3 + 2e-3)))
    check(outcome)
    assert not outcome.refusal


@pytest.mark.parametrize("seed", thin(range(6), 2))
def test_wrong_period_is_refused(seed):
    assert judged(draw("wrong period", seed)).refusal


def test_truths_are_known_answers():
    """Published multipliers, and those of matrices that are exact in binary."""
    np.testing.assert_allclose(np.sort(reference_pulse().exponents.real), [-1.33204116, 1.28204116], atol=5e-9)
    mathieu, _ = integrated(lambda t: oscillator(1 - Real("0.4") * np.cos(2 * t)), panels_of(np.pi, 2.0), np.pi)
    np.testing.assert_allclose(np.sort(mathieu.real), np.array([-1, 1]) * 0.099536437275513447, rtol=1e-15)
    np.testing.assert_allclose(reference_jump().exponents.real, -0.05, atol=1e-15)
    np.testing.assert_allclose(np.abs(reference_jump().exponents.imag), 1.1982763, atol=5e-8)
    non_normal = eigenvalues(reference_non_normal().A(np.zeros(1))[0])
    np.testing.assert_allclose(np.sort(non_normal.real), [-4, -3, -2, -1], rtol=1e-15)


def told(case, exponents=None, claim=1e-9, verdict="undecided"):
    exponents = case.exponents if exponents is None else exponents
    errors = np.broadcast_to(claim, exponents.shape)
    return judged(case, lambda _: SimpleNamespace(exponents=exponents, errors=errors, verdict=verdict))


def test_the_judge_accepts_the_truth_and_catches_a_liar():
    case = draw("rotation", 2)
    turned = case.exponents[::-1] + 2j * np.pi / case.period
    assert told(case, turned).worst < 1e-3
    assert told(case, case.exponents + 2e-9).worst == pytest.approx(2, rel=1e-3)
    assert told(case, case.exponents + np.nan).worst > 1e3
    growing = "unstable" if case.growth[0] > 0 else "stable"
    assert told(case, verdict=growing).wrong == ""
    assert told(case, verdict={"stable": "unstable", "unstable": "stable"}[growing]).wrong
    assert told(replace(case, refuse=True)).wrong
    assert told(replace(case, marginal=True), verdict="stable").wrong


def test_hidden_exponents_must_lie_below_the_others():
    case = draw("stiff", 5)
    order = np.argsort(case.exponents.real)
    hide = np.where(np.arange(len(order)) == 0, np.inf, 1e-6)
    assert told(case, case.exponents[order], claim=hide).worst < 1
    assert told(case, case.exponents[order[::-1]], claim=hide).worst > 1e3
