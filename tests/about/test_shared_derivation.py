"""Equations that are derived once: the loop closed on the arm's own, numbers left free for later; against separate derivations."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.about import with_control
from flexlin.answers import analyse, build_with_free, find_margin

PID = {"kind": "pid", "kp": [3.0], "ki": [1.0], "kd": [0.5]}


@pytest.mark.parametrize(
    ("name", "changes", "free"),
    [
        ("single-link", {}, ["motion.frequency", "control.feedback.kp.0"]),
        ("single-link", {"control.feedforward": "none"}, []),
        ("three-link", {"control.feedback.kd": [0.1, 0.2, 0.3]}, ["effects.payload.mass"]),
        ("spinning-link", {}, []),
        ("pick-and-place", {}, []),
    ],
)
def test_a_loop_closed_later_is_the_loop(name: str, changes: dict, free: list[str]) -> None:
    scene = fl.load_scene(name, changes)
    arm = fl.build_manipulator(scene, free)
    plant = fl.linearize(arm, scene.motion)
    one, other = fl.linearize(arm, scene.motion, scene.control), with_control(plant, scene.control)
    t = np.linspace(0, plant.period, 11)
    for value, closed, bare in zip(*(vars(lin.sample(t)).values() for lin in (one, other, plant)), strict=True):
        np.testing.assert_allclose(closed, value, rtol=1e-12, atol=1e-12 * (np.abs(value).max(initial=0.0) + 1e-9))
        assert closed.shape == bare.shape
    assert other.control is scene.control
    moved = 1.3 * arm.parameters.values
    if free:
        a, b = (lin.at_numbers(moved, 1.7).sample(t) for lin in (one, other))
        np.testing.assert_allclose(a.K, b.K, rtol=1e-12, atol=1e-12 * np.abs(b.K).max())


def test_a_controller_with_states_is_closed_later_too() -> None:
    scene = fl.load_scene("single-link", {"control.feedback": PID})
    arm = fl.build_manipulator(scene)
    one, other = (
        fl.linearize(arm, scene.motion, scene.control),
        with_control(fl.linearize(arm, scene.motion), scene.control),
    )
    assert one.states == other.states > 2 * one.n
    np.testing.assert_allclose(other.A(np.array([0.3])), one.A(np.array([0.3])), rtol=1e-10)


@pytest.mark.slow
def test_numbers_left_free_move_no_answer() -> None:
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    ranges = {"motion.frequency": (0.125, 4.0), "effects.payload.mass": (0.01, 0.2)}
    free, plain = analyse(scene, free=tuple(ranges)), analyse(scene)
    assert free.arm.parameters.paths == tuple(ranges)
    np.testing.assert_allclose(free.own.floquet.exponents, plain.own.floquet.exponents, atol=1e-9)
    np.testing.assert_allclose(free.linear_range.amplitudes, plain.linear_range.amplitudes, rtol=1e-3)
    for path, limits in ranges.items():
        alone = find_margin(scene, path, limits)
        shared = find_margin(scene, path, limits, known=free.closed)
        assert [one.kind for one in shared.critical] == [one.kind for one in alone.critical]
        np.testing.assert_allclose([o.value for o in shared.critical], [o.value for o in alone.critical], rtol=1e-6)


def test_what_cannot_stay_free_is_derived_as_before() -> None:
    for name, free in (
        ("single-link", "links.0.modes"),
        ("khang-2019", "parameters.payload_mass"),
        ("single-link", "no"),
    ):
        scene = fl.load_scene(name)
        assert build_with_free(scene, [free]).parameters.paths == ()
    one_way = {"kind": "point-to-point", "course": "one-way", "move_time": 0.6, "joints": [{"waypoints": [-1.2, -0.4]}]}
    scene = fl.load_scene("single-link", {"motion": one_way, "designs": []})
    assert build_with_free(scene, ["effects.payload.mass"]).parameters.paths == ()
