"""Coordinates say what they are: nothing reads it off their names."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.control import bending
from flexlin.mechanics import Coordinate, make_shapes
from tests.thinned import thin

from .scenes import arm_of, scene_of


@pytest.mark.parametrize("link", thin([9, 0]))
def test_a_strain_gauge_on_an_arm_of_ten_links_reads_one_link(link):
    """The names w11 and w101 share their beginnings with those of other links."""
    scene = scene_of(*[{"modes": 2}] * 10)
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    row = bending(scene, lin, link=link, at=0.0)(np.zeros(1))[0, 0]
    columns = [10 + 2 * link, 11 + 2 * link]
    assert np.flatnonzero(row).tolist() == columns
    curvature = make_shapes(scene, link).values(np.array([0.0]), 2)[:, 0] / scene.links[link].length ** 2
    np.testing.assert_allclose(row[columns], curvature, rtol=1e-14)


def test_a_prescribed_joint_moves_the_columns():
    joints = [{"amplitude": 0.2, "drive": "prescribed"}, {"amplitude": 0.2}]
    scene = scene_of({"modes": 1}, {"modes": 3}, motion={"kind": "harmonic", "frequency": 1.0, "joints": joints})
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    assert [c.name for c in lin.coordinates] == list(lin.names) == ["q2", "w11", "w21", "w22", "w23"]
    assert np.flatnonzero(bending(scene, lin, link=1, at=0.3)(np.zeros(1))[0, 0]).tolist() == [2, 3, 4]


def test_a_chain_describes_itself():
    arm = arm_of(
        {"modes": 1},
        {"modes": 11, "joint": "prismatic"},
        effects={"joint_flexibility": {"stiffness": 50.0, "motor_inertia": 0.01}},
    )
    assert len(arm.coordinates) == arm.n == 16
    assert arm.coordinates[:3] == (
        Coordinate("joint", "q1", "rad", 0),
        Coordinate("joint", "q2", "m", 1),
        Coordinate("elastic", "w11", "m", 0, 0),
    )
    assert arm.coordinates[13] == Coordinate("elastic", "w2_11", "m", 1, 10)
    assert arm.coordinates[14:] == (Coordinate("motor", "theta1", "rad", 0), Coordinate("motor", "theta2", "m", 1))
    assert len(set(arm.names)) == arm.n


def test_names_of_eleven_links_do_not_meet():
    names = arm_of(*[{"modes": modes} for modes in (12, 2, 1, 1, 1, 1, 1, 1, 1, 11, 2)]).names
    assert len(set(names)) == len(names)


def test_a_model_of_ones_own_has_joints_where_the_motion_is_and_elastic_coordinates_elsewhere():
    s, s_dot = ca.SX.sym("s", 3), ca.SX.sym("s_dot", 3)
    arm = fl.Manipulator.from_lagrangian(
        s, s_dot, ca.sumsqr(s_dot) / 2, ca.sumsqr(s), joints=(2, 0), names=("wrist", "q", "walk")
    )
    assert [(c.kind, c.name, c.unit, c.link) for c in arm.coordinates] == [
        ("joint", "wrist", "rad", 1),
        ("elastic", "q", "m", None),
        ("joint", "walk", "rad", 0),
    ]


def test_names_must_fit():
    s, s_dot = ca.SX.sym("s", 2), ca.SX.sym("s_dot", 2)
    with pytest.raises(fl.errors.ModelError, match="3 names"):
        fl.Manipulator.from_lagrangian(s, s_dot, ca.sumsqr(s_dot), ca.sumsqr(s), names=("a", "b", "c"))
