"""Every hard case: flexlin near the known exponents and within its own error, the naive code far off or blind to it."""

import pytest

import flexlin as fl
from tests.periodic.hard_cases import CASES, forty_modes, naive_exponents, worst_miss

FORGIVEN = {"tongue as narrow as rounding", "just past a Krein collision"}
"""Cases where the naive exponents are good and only its verdict, which knows no error, is a matter of luck."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_hard_case(case):
    system, known = case.build()
    result = fl.floquet(system, **case.options)
    miss = worst_miss(result.exponents, known, system.period)
    assert miss <= case.near
    assert miss <= result.error + 1e-8 * (case.name == "nearly rigid link (EI x 1e8)")  # the limit itself is 1e-8 away
    assert result.verdict == case.verdict
    naive = worst_miss(naive_exponents(system, case.steps), known, system.period)
    assert case.name in FORGIVEN or naive > 10 * miss


@pytest.mark.slow
def test_what_is_claimed_of_forty_modes_depends_on_no_count_of_segments():
    """Bases that are found once lose digits at some counts and not at others."""
    system, known = forty_modes()
    for segments in (26, 31):
        result = fl.floquet(system, 1e-11, method="gauss", order=14, segments=segments)
        miss = worst_miss(result.exponents, known, system.period)
        assert miss <= result.error <= 1e-8, segments
        assert result.verdict == "stable"
