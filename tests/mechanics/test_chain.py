"""The chain's geometry: prismatic joints, a moving base, other shapes, tapers, and the energy of a free motion."""

import numpy as np
import pytest
from scipy.linalg import eigh

import flexlin as fl
from flexlin.mechanics import clamped_with_tip, pinned_with_hub

from .scenes import arm_of, linear, matrices_at_rest, plain_scene, random_state, scene_of, swinging, value

CARRIAGE = {"length": 0.0, "mass_per_length": 0.0, "modes": 0, "joint": "prismatic"}
ROD = {"length": 0.6, "mass_per_length": 0.5, "modes": 0}


def test_pendulum_on_a_cart():
    """Cart mass m_c on a rail, rod of mass m, length l: the textbook's equations."""
    arm = arm_of(CARRIAGE, ROD, effects={"gravity": {}, "hub": {"mass": [0.7, 0.0]}})
    m, length, g = 0.3, 0.6, 9.81
    for seed in range(3):
        (x, q), (_, rate), (a, b) = random_state(arm, seed)
        expected = [
            (0.7 + m) * a - m * length / 2 * (np.sin(q) * b + np.cos(q) * rate**2),
            m * length**2 / 3 * b - m * length / 2 * np.sin(q) * a + m * g * length / 2 * np.cos(q),
        ]
        got = value(arm, "residual", np.array([x, q]), np.array([1.3, rate]), np.array([a, b]))[:, 0]
        np.testing.assert_allclose(got, expected, rtol=1e-12)


def test_moving_base_is_a_prescribed_carriage():
    """A base that shakes sideways with x = a cos wt turns gravity's direction: K = -m l/2 (sin q g + cos q x'') about q."""
    joints = [{"amplitude": 0.05, "drive": "prescribed"}, {"mean": 0.4, "amplitude": 0.0}]
    lin = linear(plain_scene([CARRIAGE, ROD], swinging(*joints, frequency=2.0), effects={"gravity": {}}))
    t = np.linspace(0, 0.5, 7)
    acceleration = lin.motion.sample(t)[2][:, 0]
    np.testing.assert_allclose(np.abs(acceleration).max(), 0.05 * (2 * np.pi * 2.0) ** 2, rtol=0.2)
    expected = -0.3 * 0.6 / 2 * (np.cos(0.4) * acceleration + np.sin(0.4) * 9.81)
    assert lin.names == ("q2",)
    np.testing.assert_allclose(lin.K(t)[:, 0, 0], expected, rtol=1e-10, atol=1e-12)


def free_frequencies(shapes, modes, hub=0.03):
    M, K = matrices_at_rest(arm_of({"mode_shapes": shapes, "modes": modes}, effects={"hub": {"inertia": hub}}))
    return np.sqrt(np.abs(eigh(K, M, eigvals_only=True)))


def test_pinned_shapes_are_the_free_modes():
    """A link on a free hub: pinned-hub shapes give its frequencies at once, clamped ones converge to them from above."""
    exact = pinned_with_hub(3, 0.03 / (0.2 * 0.5**3)).beta ** 2 * np.sqrt(1.0 / (0.2 * 0.5**4))
    np.testing.assert_allclose(free_frequencies("pinned-hub", 3)[1:], exact, rtol=1e-10)
    errors = [free_frequencies("clamped-free", modes)[1:4] / exact - 1 for modes in (4, 8, 16)]
    assert np.all(np.diff(errors, axis=0) < 0)
    assert np.all(np.array(errors) > 0)
    assert np.all(errors[-1] < 1e-3)


def test_loaded_shapes_are_the_modes_with_payload():
    effects = {"payload": {"mass": 0.2, "inertia": 0.004}}
    exact = clamped_with_tip(2, 2.0, 0.004 / (0.2 * 0.5**3)).beta ** 2 * np.sqrt(1.0 / (0.2 * 0.5**4))
    M, K = matrices_at_rest(arm_of({"mode_shapes": "clamped-loaded"}, effects=effects))
    np.testing.assert_allclose(np.sqrt(eigh(K[1:, 1:], M[1:, 1:], eigvals_only=True)), exact, rtol=1e-10)
    given = arm_of({"mode_shapes": "clamped-loaded", "carried": {"mass": 0.2, "inertia": 0.004}}, effects=effects)
    np.testing.assert_allclose(value(given, "M", np.zeros(3)), M, rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize(
    ("link", "effects", "message"),
    [
        ({"length": 0.0}, {}, "length"),
        ({"carried": {"mass": 1.0}}, {}, "clamped-loaded"),
        ({"mode_shapes": "pinned-free"}, {"hub": {"radius": 0.1}}, "effects.hub.radius"),
        ({}, {"hub": {"inertia": [1.0, 2.0]}}, "at most 1"),
        ({}, {"shear": {"stiffness": [1e3, 1e3]}}, "shear.stiffness: got 2 numbers, expected 1, one for each link"),
        ({"sections": {"at": [0.0, 0.5], "mass": [1.0, 1.0], "stiffness": [1.0, 1.0]}}, {}, "from 0 to 1"),
        ({}, {"tip_force": {"frame": "base"}}, "effects.tip_force.frame: got 'base'"),
        ({}, {"tip_force": {"phase": 0.4}}, "harmonic of at least 1 beside phase"),
        ({}, {"shear": {"stiffness": 0.0}}, "greater than 0"),
        ({}, {"motor": {"torque_constant": 1.0}}, "resistance"),
        ({"modes": {"torsion": 1}, "polar_inertia": 1.0}, {}, "links.0.torsional_stiffness"),
        ({"modes": {"torsion": 1}, "torsional_stiffness": 1.0}, {}, "links.0.polar_inertia"),
        ({"modes": {"z": 1}, "bending_stiffness": None}, {}, "links.0.bending_stiffness"),
        (
            {"polar_inertia": 1e-4},
            {"rotary_inertia": {"radius_of_gyration": 0.03}},
            "got 0.03, expected 0.02236 at most",
        ),
        ({"modes": {"x": 1}}, {}, "links.0.modes.x"),
        ({"modes": {"y": -1}}, {}, "links.0.modes.y"),
        ({"modes": {"y": 1, "z": 1}, "mode_shapes": "pinned-free"}, {}, "links.0.mode_shapes"),
        ({"modes": 1, "bending_stiffness": [1.0, 2.0, 3.0]}, {}, "links.0.bending_stiffness"),
        ({"axis": [0, 0, 0]}, {}, "links.0.axis"),
        ({"axis": [0, 1]}, {}, "links.0.axis.2"),
        ({"axis": [0, 1, 0], "joint": "fixed"}, {}, "links.0.axis"),
        ({"mount": {"xyz": [0, 0]}}, {}, "links.0.mount.xyz.2"),
        ({"mount": {"rpy": [0, 0, float("inf")]}}, {}, "links.0.mount.rpy.2"),
        ({"body": {"mass": -1.0}}, {}, "links.0.body.mass"),
        ({"body": {"mass": 1.0, "inertia": {"xx": 1.0, "yy": 1.0, "xy": 2.0}}}, {}, "links.0.body.inertia"),
        ({"axis": [0, 1, 0], "modes": 1, "mode_shapes": "pinned-free"}, {}, "links.0.mode_shapes"),
    ],
)
def test_contradictions_are_named(link, effects, message):
    with pytest.raises(fl.errors.SceneError, match=message):
        scene_of(link, effects=effects)


def test_pinned_hub_shapes_need_a_hub():
    with pytest.raises(fl.errors.ArgumentError, match=r"effects\.hub"):
        arm_of({"mode_shapes": "pinned-hub"})


def test_coordinates_bear_the_names_of_the_robots_joints():
    scene = fl.load_scene("spatial-arm")
    arm = fl.build_manipulator(scene)
    assert [one.title for one in arm.coordinates[:4]] == ["q1 (turret)", "q2 (shoulder)", "q3 (elbow)", "w21"]
    lin = fl.linearize(arm, scene.motion, scene.control)
    assert "q2 (shoulder) in rad" in repr(lin)
    assert lin.to_xarray(3)["joint"].values.tolist()[:4] == ["turret", "shoulder", "elbow", ""]
