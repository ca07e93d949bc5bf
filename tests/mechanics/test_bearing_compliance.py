"""Bearings that give across their joint: energies by finite rotations, whirling rotors, drooping arms, what a scene may say."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.mechanics import directions_across, unit

from .scenes import held, linear, plain_scene
from .spatial import scene_table


def test_the_two_directions_across_any_axis():
    rng = np.random.default_rng(1)
    for axis in (*np.eye(3), *-np.eye(3), *rng.normal(size=(20, 3)), np.array([1e-9, 0, -1.0])):
        across = np.array(ca.DM(ca.densify(directions_across(unit(axis)))))
        E = np.column_stack([across, axis / np.linalg.norm(axis)])
        np.testing.assert_allclose(E.T @ E, np.eye(3), atol=1e-12)
        assert np.linalg.det(E) == pytest.approx(1.0)


@pytest.mark.parametrize("spin", [0.0, 3.0, 40.0])
def test_a_rotor_on_a_soft_bearing_whirls(spin):
    """J_t b'' + i J_p Omega b' + d b' + k b = 0 with b = beta_1 + i beta_2: forward and backward whirl (Genta, section 4.6)."""
    k, d, across_axis, along = 30.0, 0.02, 0.05, 0.08
    body = {"mass": 2.0, "inertia": {"xx": across_axis, "yy": across_axis, "zz": along}}
    motion = {"kind": "rotation", "drive": "prescribed", "joints": [{"rate": spin}]} if spin else held()
    soft = {"bearing_compliance": {"stiffness": k, "damping": d}}
    found = np.linalg.eigvals(linear(plain_scene([{"body": body}], motion, effects=soft)).A(0.0))
    whirl = np.roots([across_axis, d - 1j * along * spin, k])
    expected = np.concatenate([whirl, whirl.conj()])
    apart = np.abs(found[:, None] - expected)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-9 * np.abs(expected).max()


def test_a_bearing_that_does_not_give_has_no_coordinates():
    links = [{"body": {"mass": 1.0, "centre": [0.3, 0, 0]}, "joint": "revolute"}] * 2
    table = scene_table(links, bearing_compliance={"stiffness": [0.0, 5.0]})
    assert fl.build_manipulator(fl.parse_scene(table)).names == ("q1", "q2", "beta21", "beta22")
    weighted = {"name": "d", "kind": "periodic-lqr", "state_weight": [1.0] * 8, "input_weight": [1.0, 1.0]}
    assert len(fl.parse_scene({**table, "designs": [weighted]}).designs[0].state_weight) == 8
    with pytest.raises(fl.errors.SceneError, match=r"8, one for each state"):
        fl.parse_scene({**table, "designs": [{**weighted, "state_weight": [1.0] * 4}]})
    with pytest.raises(fl.errors.SceneError, match=r"effects\.bearing_compliance\.stiffness"):
        fl.parse_scene({**table, "effects": {"bearing_compliance": {"stiffness": -1.0}}})
