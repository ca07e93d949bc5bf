"""Every hard case: flexlin near the known exponents and within its own error, the naive code far off or blind to it."""

from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from tests.periodic.hard_cases import CASES
from tests.periodic.hard_systems import forty_modes, forty_modes_one_by_one
from tests.periodic.naive import naive_exponents, worst_miss

DOCUMENT = Path(__file__).parents[3] / "docs" / "hard-cases.md"
ROUNDING = 1e-9
"""Misses below it differ from one processor to another, in 1/s."""
FORGIVEN = {"tongue as narrow as rounding", "just past a Krein collision"}
"""Cases where the naive exponents are good and only its verdict, which knows no error, is a matter of luck."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_hard_case(case):
    system, known = case.build(), case.known()
    result = fl.floquet(system, **case.options)
    miss = worst_miss(result.exponents, known, system.period)
    assert miss <= case.near
    assert miss <= result.error + 1e-8 * (case.name == "nearly rigid link (EI x 1e8)")  # the limit itself is 1e-8 away
    assert result.verdict == case.verdict
    naive = worst_miss(naive_exponents(system, case.steps), known, system.period)
    assert case.name in FORGIVEN or naive > 10 * miss
    compare_with_the_page(case, result, miss, naive)


@pytest.mark.slow
def test_what_is_claimed_of_forty_modes_depends_on_no_count_of_segments():
    """Bases that are found once lose digits at some counts and not at others."""
    system, known = forty_modes(), forty_modes_one_by_one()
    for segments in (26, 28, 31):
        result = fl.floquet(system, 1e-11, method="gauss", order=14, segments=segments)
        miss = worst_miss(result.exponents, known, system.period)
        assert miss <= result.error <= 1e-8, segments
        assert result.verdict == "stable"


def compare_with_the_page(case, result, miss, naive):
    """The row of docs/hard-cases.md: words, verdict and method as they are, misses of the same order of magnitude."""
    shown = next(
        line for line in DOCUMENT.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {case.name} |")
    )
    _, why, source, shown_naive, shown_miss, shown_error, verdict, method = [
        cell.strip() for cell in shown[1:-1].split("|")
    ]
    assert (why, source, verdict) == (case.why, case.source, result.verdict)
    assert method.split()[0] == result.setting.method
    assert alike(float(shown_miss), miss)
    assert alike(float(shown_error), result.error)
    assert (shown_naive == "overflow") == (not np.isfinite(naive))
    assert shown_naive == "overflow" or alike(float(shown_naive), naive)


def alike(shown, found):
    """Within a factor of ten, or both rounding: `make figures` writes the page anew when flexlin has become better."""
    return 0.1 < (shown + ROUNDING) / (found + ROUNDING) < 10


def test_naive_verdicts_on_the_boundary_are_luck():
    """Where the truth is a growth rate of 0, the naive verdict is the sign of an error; flexlin's names the doubt."""
    names = {"tongue as narrow as rounding", "double multiplier +1", "double multiplier -1", "Krein collision"}
    growth = [naive_exponents(case.build()).real.max() for case in CASES if case.name in names]
    assert all(value != 0 for value in growth)
    assert all(fl.floquet(case.build()).verdict == "undecided" for case in CASES if case.name in names)


def test_the_document_has_a_row_for_every_case():
    text = DOCUMENT.read_text(encoding="utf-8")
    for case in CASES:
        assert f"| {case.name} |" in text, case.name
    table = text[text.index("| case |") :].split("\n\n")[0]
    assert np.sum([line.startswith("| ") for line in table.splitlines()]) == len(CASES) + 1
