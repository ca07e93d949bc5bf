"""Where the axes of links are that bend in space, for pictures: by finite rotations and the shapes of a clamped beam."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexlin as fl
from flexlin.mechanics.links import COLUMNS, PLACES
from flexlin.report.figures.over_period import trace_arm

from .scenes import clamped_mode, linear, plain_scene, swinging, value

BEAM = {"length": 0.8, "mass_per_length": 0.3, "bending_stiffness": [5.0, 9.0], "modes": {"y": 1, "z": 1}}
MOUNT = {"xyz": [0.1, -0.2, 0.3], "rpy": [0.4, -0.7, 1.1]}
AXIS = [0.3, -1.0, 0.5]


def scene_of(*links, **effects):
    return plain_scene(list(links), swinging(*[{"mean": 0.3, "amplitude": 0.4}] * len(links)), effects=effects)


def test_a_bent_link_lies_where_its_shapes_say():
    arm = fl.build_manipulator(
        scene_of({**BEAM, "mount": MOUNT, "axis": AXIS}, {"body": {"mass": 1.0}, "mount": MOUNT})
    )
    q, v, w = 0.7, 0.05, -0.03
    s = np.array([q, 0.2, v, w])
    curves = np.split(value(arm, "axes", s), 2, axis=1)
    axis = np.array(AXIS) / np.linalg.norm(AXIS)
    turn = Rotation.from_euler("xyz", MOUNT["rpy"]) * Rotation.from_rotvec(q * axis)
    own = np.stack([0.8 * PLACES, v * clamped_mode(PLACES), w * clamped_mode(PLACES)])
    expected = np.array(MOUNT["xyz"])[:, None] + turn.as_matrix() @ own
    np.testing.assert_allclose(curves[0][:, 1:], expected, rtol=0, atol=1e-12)
    assert curves[0].shape[1] == COLUMNS
    np.testing.assert_allclose(curves[1][:, 0], expected[:, -1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(curves[1][:, 1:], np.tile(value(arm, "points", s)[:, -1:], COLUMNS - 1), atol=1e-12)


@pytest.mark.parametrize("effects", [{}, {"geometric_stiffening": {}, "bending_torsion_coupling": {}}])
def test_curves_end_at_the_tip_and_a_straight_link_has_two_points(effects):
    """The tip that effects shorten too; the links of a plane stay in it."""
    lin = linear(scene_of(BEAM, {"length": 0.5, "mass_per_length": 1.0, "axis": [0, 1, 0]}, **effects))
    t, states = np.array([0.0, 0.3]), 0.05 * np.random.default_rng(0).normal(size=(2, lin.n))
    tips = lin.about.of_arm("points", t, states)[:, :, -1]
    for (first, second), tip in zip(trace_arm(lin, t, states), tips, strict=True):
        assert (first.shape, second.shape) == ((3, COLUMNS - 1), (3, 2))
        np.testing.assert_allclose(second[:, -1], tip, rtol=0, atol=1e-14)
        chord = first[:, -1] - first[:, 0]
        assert np.linalg.norm(np.cross(first[:, 8] - first[:, 0], chord)) > 1e-3
    flat = linear(scene_of({**BEAM, "modes": 2}))
    assert trace_arm(flat, t, states[:, :3])[0][0].shape == (2, COLUMNS - 1)
