"""Why there is no stabilising solution: the mode is not reached at all, or too weakly for numbers of this precision."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import NotDetectable, NotStabilizable, NumericalError
from tests.closed_arm import opened
from tests.thinned import thin

A, OSCILLATOR = np.array([[0.5, 0.0], [0.3, -1000.0]]), np.array([[0.0, 1.0], [-1.0, -0.1]])
FORCED = np.array([[0.0], [1.0]])


@pytest.mark.parametrize("share", thin([1e-9, 1e-11]))
def test_a_mode_that_is_reached_needs_no_actuator(share: float) -> None:
    """The input's share in the unstable mode is exact here: it is said, and that scales are what is in the way."""
    with pytest.raises(NotStabilizable, match=f"too weakly to be computed with.*its share is {share:.0e}") as caught:
        fl.periodic_lqr(fl.PeriodicSystem(A, 1.0, np.array([[share], [1.0]])), np.eye(2), np.eye(1))
    assert "actuator" not in str(caught.value)


@pytest.mark.parametrize("seed", thin(range(5)))
def test_a_mode_that_is_not_reached_needs_one(seed: int) -> None:
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(2, 2)))[0]
    with pytest.raises(NotStabilizable, match=r"cannot be reached by the input.*add an actuator"):
        fl.periodic_lqr(fl.PeriodicSystem(turn @ A @ turn.T, 1.0, turn @ FORCED), np.eye(2), np.eye(1))


@pytest.mark.parametrize(
    ("share", "words"), thin([(0.0, "is not seen by the weight Q"), (1e-9, "seen by the weight Q too weakly")])
)
def test_the_same_holds_for_what_the_weight_sees(share: float, words: str) -> None:
    """Dually: a growing mode with a share in Q of a billionth, and with none."""
    seen, system = np.array([[share, 1.0]]), fl.PeriodicSystem(np.diag([0.5, -1000.0]), 1.0, np.ones((2, 1)))
    with pytest.raises(NotDetectable, match=words):
        fl.periodic_lqr(system, seen.T @ seen, np.eye(1))


@pytest.mark.slow
@pytest.mark.parametrize("swing", [0.0, 0.3])
def test_weights_that_lie_too_far_apart_are_not_said_to_hide_a_mode(swing: float) -> None:
    """Every mode is reached, seen and excited as well as can be: the weight of the input alone is in the way, or the sensor's noise."""

    def swinging(t):
        return OSCILLATOR * (1 + swing * np.cos(2 * np.pi * t))[:, None, None]

    plant = fl.PeriodicSystem(swinging, 1.0, FORCED)
    for design, words in (
        (lambda: fl.periodic_lqr(plant, np.eye(2), [[1e-100]]), r"\|B R\^-1 B'\| = 1e\+100"),
        (lambda: fl.control.kalman_filter(plant, [[1.0, 0.0]], np.eye(2), [[1e-100]]), "lie too far apart"),
    ):
        with pytest.raises(NumericalError, match=words) as caught:
            design()
        assert "lie too far apart" in str(caught.value)
        assert "excited" not in str(caught.value)
        assert not isinstance(caught.value, NotDetectable | NotStabilizable)


@pytest.mark.parametrize("effort", [1e-8, 1e-20, 1e-30])
def test_an_input_that_costs_next_to_nothing_has_an_honest_gain(effort: float) -> None:
    """X = [[1, r], [r, r]] and K = [1, 1] / r for small r = sqrt(R), to first order in r."""
    design, r = fl.periodic_lqr(fl.PeriodicSystem(OSCILLATOR, 1.0, FORCED), np.eye(2), [[effort]]), np.sqrt(effort)
    assert design.error < 0.1
    assert np.abs(design.K(0.3) * r - 1).max() <= design.error + 2 * r
    assert np.abs(design.X(0.3) - [[1, r], [r, r]]).max() <= design.solution.error + 2 * r


def test_a_stiff_damped_link_is_reached_at_every_frozen_phase() -> None:
    """A link a million times stiffer moves as a rigid one: its slowest gain is that of the rigid arm, whose design must exist too."""
    gains = []
    for changes in ({"links.0.modes": 2, "links.0.bending_stiffness": 3.6866e6}, {"links.0.modes": 0}):
        lin = opened(changes=changes)[1]
        weight = np.full(2 * lin.n, 1e-3)
        weight[[0, lin.n]] += 100.0, 1.0
        made = fl.control.frozen_lqr(lin.periodic_system(), np.diag(weight), [[0.1]])
        gains.append(made.K(np.zeros(1))[0][:, [0, lin.n]])
    assert gains[0] == pytest.approx(gains[1], rel=1e-3)
