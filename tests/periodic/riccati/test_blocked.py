"""Why there is no stabilising solution: the mode is not reached at all, or too weakly for numbers of this precision."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import NotDetectable, NotStabilizable, NumericalError
from tests.closed_arm import opened
from tests.thinned import thin

A = np.array([[0.5, 0.0], [0.3, -1000.0]])


@pytest.mark.parametrize("share", thin([1e-9, 1e-11]))
def test_a_mode_that_is_reached_needs_no_actuator(share: float) -> None:
    """The input's share in the unstable mode is exact here: it is said, and that scales are what is in the way."""
    system = fl.PeriodicSystem(A, 1.0, np.array([[share], [1.0]]))
    with pytest.raises(NotStabilizable, match="too weakly to be computed with") as caught:
        fl.periodic_lqr(system, np.eye(2), np.eye(1))
    assert f"its share is {share:.0e}" in str(caught.value)
    assert "actuator" not in str(caught.value)


@pytest.mark.parametrize("seed", thin(range(5)))
def test_a_mode_that_is_not_reached_needs_one(seed: int) -> None:
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(2, 2)))[0]
    system = fl.PeriodicSystem(turn @ A @ turn.T, 1.0, turn @ np.array([[0.0], [1.0]]))
    with pytest.raises(NotStabilizable, match="cannot be reached by the input") as caught:
        fl.periodic_lqr(system, np.eye(2), np.eye(1))
    assert "add an actuator" in str(caught.value)


@pytest.mark.parametrize("share", thin([0.0, 1e-9]))
def test_the_same_holds_for_what_the_weight_sees(share: float) -> None:
    """Dually: a growing mode with a share in Q of a billionth, and with none."""
    seen = np.array([[share, 1.0]])
    system = fl.PeriodicSystem(np.diag([0.5, -1000.0]), 1.0, np.array([[1.0], [1.0]]))
    text = "seen by the weight Q too weakly" if share else "is not seen by the weight Q"
    with pytest.raises(NotDetectable, match=text):
        fl.periodic_lqr(system, seen.T @ seen, np.eye(1))


@pytest.mark.slow
@pytest.mark.parametrize("swing", [0.0, 0.3])
def test_weights_that_lie_too_far_apart_are_not_said_to_hide_a_mode(swing: float) -> None:
    """Every mode is reached and seen as well as can be: the weight of the input alone is in the way."""

    def A(t):
        return np.array([[0.0, 1.0], [-1.0, -0.1]]) * (1 + swing * np.cos(2 * np.pi * t))[:, None, None]

    with pytest.raises(NumericalError, match="lie too far apart") as caught:
        fl.periodic_lqr(fl.PeriodicSystem(A, 1.0, np.array([[0.0], [1.0]])), np.eye(2), [[1e-100]])
    assert "|B R^-1 B'| = 1e+100" in str(caught.value)
    assert not isinstance(caught.value, NotDetectable | NotStabilizable)


@pytest.mark.slow
def test_noise_that_lies_too_far_apart_is_not_said_to_excite_no_mode() -> None:
    """An estimator's problem is the dual one: its names for blocked modes stood over this reason too."""
    plant = fl.PeriodicSystem(np.array([[0.0, 1.0], [-1.0, -0.1]]), 2.0, np.array([[0.0], [1.0]]))
    with pytest.raises(NumericalError, match="lie too far apart") as caught:
        fl.control.kalman_filter(plant, [[1.0, 0.0]], np.eye(2), [[1e-100]])
    assert "excited" not in str(caught.value)


@pytest.mark.parametrize("effort", [1e-8, 1e-20, 1e-30])
def test_an_input_that_costs_next_to_nothing_has_an_honest_gain(effort: float) -> None:
    """X = [[1, r], [r, r]] and K = [1, 1] / r for small r = sqrt(R), to first order in r."""
    system = fl.PeriodicSystem(np.array([[0.0, 1.0], [-1.0, -0.1]]), 1.0, np.array([[0.0], [1.0]]))
    design, r = fl.periodic_lqr(system, np.eye(2), [[effort]]), np.sqrt(effort)
    assert design.error < 0.1
    assert np.abs(design.K(0.3) * r - 1).max() <= design.error + 2 * r
    assert np.abs(design.X(0.3) - [[1, r], [r, r]]).max() <= design.solution.error + 2 * r


def test_a_stiff_damped_link_is_reached_at_every_frozen_phase() -> None:
    """A link a million times stiffer moves as a rigid one: its slowest gain is that of the rigid arm, whose design must exist too."""
    from flexlin.control import frozen_lqr

    scenes = [{"links.0.modes": 2, "links.0.bending_stiffness": 3.6866e6}, {"links.0.modes": 0}]
    gains = []
    for changes in scenes:
        lin = opened(changes=changes)[1]
        weight = np.zeros(2 * lin.n)
        weight[[0, lin.n]] = 100.0, 1.0
        made = frozen_lqr(lin.periodic_system(), np.diag(weight + 1e-3), np.diag([0.1]))
        gains.append(made.K(np.zeros(1))[0][:, [0, lin.n]])
    assert gains[0] == pytest.approx(gains[1], rel=1e-3)
