"""The chain: shapes and tapers, names and kinds of coordinates, what tables contradict, and how many instructions the equations have."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.mechanics import Coordinate, Ends, bending_shapes, make_shapes
from flexlin.scene import builtin_scenes
from studies.scaling import scene_of as chain_of
from tests.thinned import thin

from .scenes import arm_of, linear, random_state, scene_of, swinging, value
from .spatial import random_chain, scene_table


def test_what_a_link_is_said_to_carry_shapes_it():
    scene = scene_of({"mode_shapes": "clamped-loaded", "carried": {"mass": 0.2, "inertia": 0.004}})
    exact = bending_shapes(2, ends=Ends(2.0, 0.004 / (0.2 * 0.5**3)))
    np.testing.assert_allclose(make_shapes(scene, 0).beta, exact.beta, rtol=1e-12)


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
        ({}, {"motor": {"torque_constant": 1.0}}, "resistance"),
        ({}, {"coulomb_friction": {"torque": 0.1, "static": 0.2, "at": "motor"}}, "only joints stick"),
        ({"modes": {"torsion": 1}, "polar_inertia": 1.0}, {}, "links.0.torsional_stiffness"),
        ({"modes": {"torsion": 1}, "torsional_stiffness": 1.0}, {}, "links.0.polar_inertia"),
        ({"modes": {"z": 1}, "bending_stiffness": None}, {}, "links.0.bending_stiffness"),
        ({"polar_inertia": 1e-4}, {"rotary_inertia": {"radius_of_gyration": 0.03}}, "0.03, expected 0.02236 at most"),
        ({"modes": {"x": 1}}, {}, "links.0.modes.x"),
        ({"modes": {"y": 1, "z": 1}, "mode_shapes": "pinned-free"}, {}, "links.0.mode_shapes"),
        ({"modes": 1, "bending_stiffness": [1.0, 2.0, 3.0]}, {}, "links.0.bending_stiffness"),
        ({"axis": [0, 0, 0]}, {}, "links.0.axis"),
        ({"axis": [0, 1, 0], "joint": "fixed"}, {}, "links.0.axis"),
        ({"mount": {"rpy": [0, 0, float("inf")]}}, {}, "links.0.mount.rpy.2"),
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


def test_the_axis_may_stay_a_symbol():
    """Its derivative is that of the forces by finite differences of the axis."""
    scene = fl.parse_scene(scene_table(random_chain(np.random.default_rng(2), 2, fixed=0.0)))
    arm = fl.build_manipulator(scene, ["links.1.axis.0"])
    p, state, residual = arm.parameters, random_state(arm, 1), arm.functions["residual"]
    slope = ca.Function("f", [arm.s, arm.s_dot, arm.s_ddot, p.symbols], [ca.jacobian(arm.residual, p.symbols)])
    change = (residual(*state, p.values + 1e-6) - residual(*state, p.values - 1e-6)).full() / 2e-6
    np.testing.assert_allclose(slope(*state, p.values).full(), change, rtol=1e-6)


def test_the_puma_is_the_published_one():
    """Inertia at the motors and gravity at the nominal pose of Corke's robotics toolbox (Robotics, Vision and Control, section 9.2)."""
    inertias = np.array(fl.load_scene("puma-560").effects.joint_flexibility.motor_inertia)
    bare = {"effects.payload": "off", "effects.joint_flexibility": "off"}
    arm = fl.build_manipulator(fl.load_scene("puma-560", bare))
    q = np.array([0, np.pi / 4, np.pi, 0, np.pi / 4, 0])
    M = value(arm, "M", q) + np.diag(inertias)
    np.testing.assert_allclose(M[0], [3.6594, -0.4044, 0.1006, -0.0025, 0, 0], atol=6e-5)
    np.testing.assert_allclose(np.diag(M), [3.6594, 4.4137, 0.9378, 0.1925, 0.1713, 0.1941], atol=1.1e-4)
    np.testing.assert_allclose(value(arm, "g", q)[:, 0], [0, 31.6399, 6.0351, 0, 0.0283, 0], atol=6e-5)


PLANAR = {  # instructions of the residual and of (M, D, K, h) when frames and moments knew the plane only
    (1, 2): (498, 272),
    (2, 2): (1200, 1877),
    (6, 1): (2184, 12444),
    "pick-and-place": (973, 1893),
    "single-link": (499, 271),
    "three-link": (1088, 2993),
}


@pytest.mark.parametrize("name", PLANAR, ids=str)
def test_a_planar_arm_costs_what_a_planar_code_costs(name):
    """Frames and moments are spatial; what never leaves the plane has no entries, and so no instructions."""
    scene = fl.load_scene(builtin_scenes()[name]) if isinstance(name, str) else chain_of(*name)
    arm = fl.build_manipulator(scene)
    lin = fl.linearize(arm, scene.motion, scene.control)
    counts = arm.near.functions["residual"].n_instructions(), lin.coefficients.n_instructions()
    assert counts[0] <= 1.05 * PLANAR[name][0]
    assert counts[1] <= 1.05 * PLANAR[name][1]
    assert arm.points.shape[0] == 2


CURVED = {1: 800, 2: 1200, 4: 2300, 6: 4300}
"""The same of the residual at any deflection, by modes: some ten for each pair of places."""


@pytest.mark.parametrize("modes", CURVED)
def test_a_curve_costs_the_square_of_its_places(modes):
    """2 n + 6 places: fewer instructions than the second order of many modes with its Coriolis terms, and square in n."""
    effects = {"gravity": {}, "payload": {"mass": 0.1}, "geometric_stiffening": {}, "modal_damping": {"ratio": 0.01}}
    arm = fl.build_manipulator(scene_of({"modes": modes}, effects=effects))
    assert arm.functions["residual"].n_instructions() < CURVED[modes]


def test_a_curve_of_many_elements_costs_as_many_places():
    """Of 40 finite elements all pairs of places would be 64,000 instructions, and hundreds of MB with Coriolis terms."""
    link = {"modes": 2, "mode_shapes": "finite-element"}
    arms = (arm_of({**link, "elements": count}, effects={"geometric_stiffening": {}}) for count in (20, 40))
    coarse, fine = (arm.functions["residual"].n_instructions() for arm in arms)
    assert fine < 2.1 * coarse < 20_000
