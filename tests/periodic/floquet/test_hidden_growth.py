"""Modes that grow while they turn faster than Radau's segments follow: an L-stable method damps them, whatever they do."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import TooManySegments
from flexlin.periodic import hidden_growth
from tests.periodic.chains import Rotation, Wave
from tests.periodic.judge import judged
from tests.periodic.random_systems import draw
from tests.periodic.rotated import Rotated

T = 2.0


def turned(growth: float, turning: float) -> fl.PeriodicSystem:
    """A pair growth +- i turning beside -5 and -30000, in axes that turn to and fro once a period."""
    modes, angle = [(Wave(growth), Wave(turning)), (Wave(-5.0), None), (Wave(-3e4), None)], Wave(0.0, 0, (0.0,), (0.3,))
    return fl.PeriodicSystem(Rotated(T, modes, [Rotation(0, 2, angle), Rotation(1, 3, angle)]), T)


@pytest.mark.parametrize(("growth", "turning"), [(50.0, 1000.0), (-1.0, 800.0)])
@pytest.mark.parametrize("segments", [None, 300])
def test_no_mode_is_thought_away(growth: float, turning: float, segments: int | None) -> None:
    try:
        found = fl.floquet(turned(growth, turning), 1e-4, method="radau", segments=segments)
    except TooManySegments:
        return
    assert found.verdict == "undecided" or abs(found.exponents[0].real - growth) <= found.errors[0]


@pytest.mark.slow
def test_growth_by_the_change_of_a_shape_counts():
    """Unequal segments, and eigenvectors that turn: a fast pair that grows by 0.11 1/s was held to decay by 0.12 1/s."""
    case = draw("kept shapes", 77003000077)
    system = case.system()
    growth = hidden_growth(system, np.linspace(0.0, system.period, 4001))
    assert abs(growth - case.exponents.real.max()) < 1e-3
    assert judged(case).worst <= 1
