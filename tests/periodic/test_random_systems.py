"""The jury itself: truths that share nothing agree within their doubts, and the judge catches a liar."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.periodic.chains import Real
from tests.periodic.judge import judged
from tests.periodic.jumping_systems import reference_jump, reference_pulse
from tests.periodic.non_normal_systems import reference_non_normal
from tests.periodic.random_systems import COUNTS, draw
from tests.periodic.systems import oscillator
from tests.periodic.truths import eigenvalues, integrated, panels_of


def test_known_answers():
    np.testing.assert_allclose(np.sort(reference_pulse().exponents.real), [-1.33204116, 1.28204116], atol=5e-9)
    mathieu, _ = integrated(lambda t: oscillator(1 - Real("0.4") * np.cos(2 * t)), panels_of(np.pi, 2.0), np.pi)
    np.testing.assert_allclose(np.sort(mathieu.real), np.array([-1, 1]) * 0.099536437275513447, rtol=1e-15)
    np.testing.assert_allclose(reference_jump().exponents.real, -0.05, atol=1e-15)
    np.testing.assert_allclose(np.abs(reference_jump().exponents.imag), 1.1982763, atol=5e-8)
    non_normal = eigenvalues(reference_non_normal().A(np.zeros(1))[0])
    np.testing.assert_allclose(np.sort(non_normal.real), [-4, -3, -2, -1], rtol=1e-15)


@pytest.mark.slow
def test_every_kind_is_drawn_the_same_twice():
    for kind in COUNTS:
        one, two = draw(kind, 3), draw(kind, 3)
        t = np.linspace(0, one.period, 7)
        np.testing.assert_array_equal(one.A(t), two.A(t))
        np.testing.assert_array_equal(one.exponents, two.exponents)
        assert one.A(t).shape == (7, len(one.exponents), len(one.exponents))
        assert one.doubt.max() < (1e-3 if kind == "jordan" else 1e-5)


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
