"""Bearings that give across their joint: whirling rotors, and what a scene may say."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import SceneError
from flexlin.scene import parse_scene

from .scenes import held, linear, plain_scene
from .spatial import scene_table


@pytest.mark.parametrize("spin", [0.0, 3.0, 40.0])
def test_a_rotor_on_a_soft_bearing_whirls(spin):
    """J_t b'' + i J_p Omega b' + d b' + k b = 0 with b = beta_1 + i beta_2: forward and backward whirl (Genta, section 4.6)."""
    k, d, across_axis, along = 30.0, 0.02, 0.05, 0.08
    body = {"mass": 2.0, "inertia": {"xx": across_axis, "yy": across_axis, "zz": along}}
    motion = {"kind": "rotation", "drive": "prescribed", "joints": [{"rate": spin}]} if spin else held()
    scene = plain_scene([{"body": body}], motion, effects={"bearing_compliance": {"stiffness": k, "damping": d}})
    A = linear(scene).A(np.zeros(1))[0]
    whirl = np.roots([across_axis, d - 1j * along * spin, k])
    expected = np.concatenate([whirl, whirl.conj()])
    found = np.linalg.eigvals(A)
    assert np.abs(found[:, None] - expected).min(axis=0).max() < 1e-9 * np.abs(expected).max()
    assert np.abs(found[:, None] - expected).min(axis=1).max() < 1e-9 * np.abs(expected).max()


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
