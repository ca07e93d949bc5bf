"""Coordinates say what they are: nothing reads it off their names."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.mechanics import Coordinate, make_shapes
from tests.thinned import thin

from .scenes import arm_of, linear, scene_of, swinging


@pytest.mark.parametrize("link", thin([9, 0]))
def test_a_strain_gauge_on_an_arm_of_ten_links_reads_one_link(link):
    """The names w11 and w101 share their beginnings with those of other links."""
    scene = scene_of(*[{"modes": 2}] * 10)
    lin = linear(scene)
    row = fl.control.bending(scene, lin, link=link, at=0.0)(np.zeros(1))[0, 0]
    columns = [10 + 2 * link, 11 + 2 * link]
    assert np.flatnonzero(row).tolist() == columns
    curvature = make_shapes(scene, link).values(np.array([0.0]), 2)[:, 0] / scene.links[link].length ** 2
    np.testing.assert_allclose(row[columns], curvature, rtol=1e-14)


def test_a_prescribed_joint_moves_the_columns():
    motion = swinging({"amplitude": 0.2, "drive": "prescribed"}, {"amplitude": 0.2})
    scene = scene_of({"modes": 1}, {"modes": 3}, motion=motion)
    lin = linear(scene)
    assert [c.name for c in lin.coordinates] == list(lin.names) == ["q2", "w11", "w21", "w22", "w23"]
    assert np.flatnonzero(fl.control.bending(scene, lin, link=1, at=0.3)(np.zeros(1))[0, 0]).tolist() == [2, 3, 4]


def test_a_chain_describes_itself():
    flexible = {"joint_flexibility": {"stiffness": 50.0, "motor_inertia": 0.01}}
    arm = arm_of({"modes": 1}, {"modes": 11, "joint": "prismatic"}, effects=flexible)
    assert len(arm.coordinates) == arm.n == 16
    assert arm.coordinates[0] == Coordinate("joint", "q1", "rad", 0)
    assert arm.coordinates[1] == Coordinate("joint", "q2", "m", 1)
    assert arm.coordinates[2] == Coordinate("elastic", "w11", "m", 0, 0)
    assert arm.coordinates[13] == Coordinate("elastic", "w2_11", "m", 1, 10)
    assert arm.coordinates[14:] == (Coordinate("motor", "theta1", "rad", 0), Coordinate("motor", "theta2", "m", 1))
    eleven = arm_of(*[{"modes": modes} for modes in (12, 2, 1, 1, 1, 1, 1, 1, 1, 11, 2)])
    assert all(len(set(one.names)) == one.n for one in (arm, eleven))


def test_a_model_of_ones_own_has_joints_where_the_motion_is_and_elastic_coordinates_elsewhere():
    s, s_dot = ca.SX.sym("s", 3), ca.SX.sym("s_dot", 3)

    def build(*names):
        T, V = ca.sumsqr(s_dot) / 2, ca.sumsqr(s)
        return fl.Manipulator.from_lagrangian(s, s_dot, T, V, joints=(2, 0), names=names)

    joints = Coordinate("joint", "wrist", "rad", 1), Coordinate("joint", "walk", "rad", 0)
    assert build("wrist", "q", "walk").coordinates == (joints[0], Coordinate("elastic", "q", "m", None), joints[1])
    with pytest.raises(fl.errors.ModelError, match="2 names"):
        build("a", "b")
