"""Bearings that give across their joint: energies by finite rotations, whirling rotors, drooping arms, what a scene may say."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexlin as fl
from flexlin.errors import SceneError
from flexlin.mechanics import directions_across, unit
from flexlin.scene import parse_scene

from .scenes import value
from .spatial import GRAVITY, mount_of, random_chain, scene_table

HARMONIC = {"kind": "harmonic", "frequency": 1.0}


def directions(axis):
    """The two directions across an axis that flexlin has chosen, which the test takes as given."""
    return np.array(ca.DM(ca.densify(directions_across(unit(axis)))))


def place(links, q, give):
    """Rotation and position of each link's frame: exp of the whole tilt before the joint's own turn."""
    R, p, joint, found = Rotation.identity(), np.zeros(3), 0, []
    for link in links:
        turn, xyz = mount_of(link)
        p, R = p + R.apply(xyz), R * Rotation.from_matrix(turn)
        if link["joint"] != "fixed":
            axis = np.array(link["axis"]) / np.linalg.norm(link["axis"])
            slack, x = directions(link["axis"]) @ give[joint], q[joint]
            joint += 1
            if link["joint"] == "revolute":
                R = R * Rotation.from_rotvec(slack) * Rotation.from_rotvec(axis * x)
            else:
                p = p + R.apply(slack + axis * x)
        found.append((R, p))
    return found


def energy(links, stiffness, inertias, q, give, rates, give_rates):
    """Kinetic and potential energy, with velocities by central differences of places, and springs across every joint."""
    h, total, joint = 1e-5, 0.0, 0
    at = [place(links, q + k * h * rates, give + k * h * give_rates) for k in (-1, 0, 1)]
    for link, before, now, after in zip(links, *at, strict=True):
        body, (R, p) = link["body"], now
        w = R.inv().apply((after[0] * before[0].inv()).as_rotvec() / (2 * h))
        J = np.array([[body["inertia"]["".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
        if link["joint"] == "revolute":
            axis = np.array(link["axis"]) / np.linalg.norm(link["axis"])
            J = J + inertias[joint] * (np.eye(3) - np.outer(axis, axis))
        joint += link["joint"] != "fixed"
        c = np.array(body["centre"])
        v = (after[1] + after[0].apply(c) - before[1] - before[0].apply(c)) / (2 * h)
        total += body["mass"] * (v @ v / 2 - GRAVITY @ (p + R.apply(c))) + w @ J @ w / 2
    return total + np.sum(np.array(stiffness)[:, None] * give**2) / 2


@pytest.mark.parametrize("seed", range(4))
def test_energies_of_any_chain_are_exact_to_second_order(seed):
    """All that a linearization holds, of chains of turning and sliding joints: half the tilt, an eighth of the difference."""
    rng = np.random.default_rng(seed)
    links = random_chain(rng, 3, fixed=0.0)
    stiffness, inertias = rng.uniform(1, 9, (2, 3)).tolist()
    inertias = [0.05 * j for j in inertias]
    tables = {"bearing_compliance": {"stiffness": stiffness, "inertia": inertias}}
    arm = fl.build_manipulator(parse_scene(scene_table(links, **tables)))
    assert arm.names[3:] == ("beta11", "beta12", "beta21", "beta22", "beta31", "beta32")
    q, rates = rng.normal(size=(2, 3))
    give, give_rates = rng.normal(size=(2, 3, 2))
    off = []
    for size in (0.04, 0.02):
        tilt, tilt_rates = size * give, size * give_rates
        state = [np.concatenate([a, b.ravel()]) for a, b in ((q, tilt), (rates, tilt_rates))]
        expected = energy(links, stiffness, inertias, q, tilt, rates, tilt_rates)
        off.append(abs(float(arm.functions["energy"](*state, [])) - expected))
    still = energy(links, stiffness, inertias, q, 0 * give, rates, 0 * give)
    straight = [np.concatenate([a, np.zeros(6)]) for a in (q, rates)]
    assert float(arm.functions["energy"](*straight, [])) == pytest.approx(still, rel=1e-8)
    assert off[0] < 1e-6 * abs(still) or off[0] / off[1] > 6.5


@pytest.mark.parametrize("spin", [0.0, 3.0, 40.0])
def test_a_rotor_on_a_soft_bearing_whirls(spin):
    """J_t b'' + i J_p Omega b' + d b' + k b = 0 with b = beta_1 + i beta_2: forward and backward whirl (Genta, section 4.6)."""
    k, d, across_axis, along = 30.0, 0.02, 0.05, 0.08
    body = {"mass": 2.0, "inertia": {"xx": across_axis, "yy": across_axis, "zz": along}}
    motion = {"kind": "rotation", "drive": "prescribed", "joints": [{"rate": spin}]}
    if not spin:
        motion = {**HARMONIC, "joints": [{"amplitude": 0.0, "drive": "prescribed"}]}
    scene = {"schema": 1, "title": "rotor", "links": [{"body": body}], "motion": motion}
    scene["effects"] = {"bearing_compliance": {"stiffness": k, "damping": d}}
    checked = parse_scene(scene)
    lin = fl.linearize(fl.build_manipulator(checked), checked.motion)
    A = lin.A(np.zeros(1))[0]
    whirl = np.roots([across_axis, d - 1j * along * spin, k])
    expected = np.concatenate([whirl, whirl.conj()])
    found = np.linalg.eigvals(A)
    assert np.abs(found[:, None] - expected).min(axis=0).max() < 1e-9 * np.abs(expected).max()
    assert np.abs(found[:, None] - expected).min(axis=1).max() < 1e-9 * np.abs(expected).max()


def test_an_arm_on_a_soft_turret_droops_and_a_carriage_swings_across_its_rail():
    """m g l = k beta; k - m g h holds a mass above its bearing; omega^2 = k / m across the rail."""
    mass, reach, k = 2.0, 0.7, 400.0
    links = [{"body": {"mass": mass, "centre": [reach, 0.0, 0.1], "inertia": {"xx": 0.1, "yy": 0.1, "zz": 0.1}}}]
    links.append({"joint": "prismatic", "axis": [0, 1, 0], "body": {"mass": 3.0}})
    effects = {"gravity": {"direction": [0, 0, -1]}, "bearing_compliance": {"stiffness": [k, 75.0]}}
    joints = [{"amplitude": 0.0}] * 2
    scene = {
        "schema": 1,
        "title": "turret",
        "links": links,
        "effects": effects,
        "motion": {**HARMONIC, "joints": joints},
    }
    arm = fl.build_manipulator(parse_scene(scene))
    assert arm.names == ("q1", "q2", "beta11", "beta12", "beta21", "beta22")
    g = value(arm, "g", np.zeros(6))[:, 0]
    np.testing.assert_allclose(g[:4], [0, 0, 0, -mass * 9.81 * reach], atol=1e-12)
    slope = np.array(ca.Function("K", [arm.s], [ca.jacobian(arm.g, arm.s)])(np.zeros(6)))
    assert slope[2, 2] == pytest.approx(k - mass * 9.81 * 0.1)
    assert slope[3, 3] == pytest.approx(k - mass * 9.81 * 0.1)
    np.testing.assert_allclose(slope[4:, 4:], 75.0 * np.eye(2), atol=1e-12)
    M = value(arm, "M", np.zeros(6))
    np.testing.assert_allclose(M[4:, 4:], 3.0 * np.eye(2), atol=1e-12)
    assert M[3, 3] == pytest.approx(0.1 + mass * (reach**2 + 0.1**2))


def test_the_two_directions_across_any_axis():
    rng = np.random.default_rng(1)
    for axis in (*np.eye(3), *-np.eye(3), *rng.normal(size=(20, 3)), np.array([1e-9, 0, -1.0])):
        E = np.column_stack([directions(axis), axis / np.linalg.norm(axis)])
        np.testing.assert_allclose(E.T @ E, np.eye(3), atol=1e-12)
        assert np.linalg.det(E) == pytest.approx(1.0)


def test_a_bearing_that_does_not_give_has_no_coordinates():
    links = [{"body": {"mass": 1.0, "centre": [0.3, 0, 0]}}] * 2
    table = scene_table([{**link, "joint": "revolute"} for link in links], bearing_compliance={"stiffness": [0.0, 5.0]})
    assert fl.build_manipulator(parse_scene(table)).names == ("q1", "q2", "beta21", "beta22")
    weighted = {"name": "d", "kind": "periodic-lqr", "state_weight": [1.0] * 8, "input_weight": [1.0, 1.0]}
    assert len(parse_scene({**table, "designs": [weighted]}).designs[0].state_weight) == 8
    with pytest.raises(SceneError, match=r"8, one for each state"):
        parse_scene({**table, "designs": [{**weighted, "state_weight": [1.0] * 4}]})
    with pytest.raises(SceneError, match=r"effects\.bearing_compliance\.stiffness"):
        parse_scene({**table, "effects": {"bearing_compliance": {"stiffness": -1.0}}})
