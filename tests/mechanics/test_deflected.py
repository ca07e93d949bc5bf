"""Deflected arms against material points and finite rotations: energies by complex steps, and where the axes of links are."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexlin as fl
from flexlin.mechanics import bending_shapes
from flexlin.mechanics.links import COLUMNS, PLACES
from flexlin.report.figures.over_period import trace_arm

from .scenes import LINK, arm_of, clamped_mode, linear, plain_scene, random_state, swinging, value

MODES, PAYLOAD, GRAVITY = 2, 0.15, 9.81
LENGTH, DENSITY, STIFFNESS = LINK["length"], LINK["mass_per_length"], LINK["bending_stiffness"]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)
XI, MASS = (NODES + 1) / 2, WEIGHTS / 2 * DENSITY * LENGTH
SHAPES = bending_shapes(MODES)


def curve(w, end):
    """int_0^end (cos, sin)(sum_k X_k' w_k / l) l dxi by quadrature, for each end in xi: an inextensible curve, (2, ends)."""
    inner = np.multiply.outer(end, XI)
    slope = np.tensordot(w, SHAPES.values(inner.ravel(), 1).reshape(MODES, *inner.shape), 1) / LENGTH
    return LENGTH * end * (np.stack([np.cos(slope), np.sin(slope)]) @ (WEIGHTS / 2))


def points(s, stiffening):
    """World positions of the points of both links and of the payload, (2, n); s may be complex."""
    origin, angle, found = np.zeros(2, dtype=complex), 0.0, []
    tip = np.ones(1)
    for link in range(2):
        angle = angle + s[link]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        w = s[2 + MODES * link : 2 + MODES * (link + 1)]

        def along(xi, origin=origin, turn=turn, w=w):
            straight = np.stack([LENGTH * xi, w @ SHAPES.values(xi)])
            return origin[:, None] + turn @ (curve(w, xi) if stiffening else straight)

        found.append(along(XI))
        origin, angle = along(tip)[:, 0], angle + (w @ SHAPES.values(tip, 1))[0] / LENGTH
    return np.hstack([*found, origin[:, None]])


def energies(s, s_dot, stiffening):
    """T and V from the points; rates by a complex step, exact to rounding."""
    masses = np.concatenate([MASS, MASS, [PAYLOAD]])
    step = 1e-30
    moved = points(s + 1j * step * s_dot, stiffening)
    T = (np.imag(moved) / step) ** 2 @ masses / 2
    w = s[2:].reshape(2, MODES)
    bending = STIFFNESS / LENGTH**3 / 2 * np.sum(w**2 * SHAPES.beta**4)
    return T.sum(), GRAVITY * np.real(moved)[1] @ masses + bending


@pytest.mark.parametrize("stiffening", [True, False])
def test_energies_of_a_deflected_arm(stiffening):
    """Equal at deflections of a tenth of the length: without stiffening to rounding, with it to that of ten places."""
    effects = {"gravity": {}, "payload": {"mass": PAYLOAD}, **({"geometric_stiffening": {}} if stiffening else {})}
    arm = arm_of({}, {}, effects=effects)
    energy = arm.functions["energy"]
    s, s_dot, _ = random_state(arm, 3, elastic=1.0)
    bend = np.where(np.arange(arm.n) < 2, 0.0, 1.0)
    at, rate = np.where(bend, 0.1 * s, s), np.where(bend, 0.1 * s_dot, s_dot)
    T, V = energies(at, rate, stiffening)
    assert float(energy(at, rate, [])) == pytest.approx(T + V, rel=1e-6 if stiffening else 1e-11)
    assert float(energy(at, np.zeros(arm.n), [])) == pytest.approx(V, rel=1e-6 if stiffening else 1e-11)


BEAM = {"length": 0.8, "mass_per_length": 0.3, "bending_stiffness": [5.0, 9.0], "modes": {"y": 1, "z": 1}}
MOUNT = {"xyz": [0.1, -0.2, 0.3], "rpy": [0.4, -0.7, 1.1]}
AXIS = [0.3, -1.0, 0.5]


def scene_of(*links, **effects):
    return plain_scene(list(links), swinging(*[{"mean": 0.3, "amplitude": 0.4}] * len(links)), effects=effects)


def test_a_bent_link_lies_where_its_shapes_say():
    body = {"body": {"mass": 1.0}, "mount": MOUNT}
    arm = fl.build_manipulator(scene_of({**BEAM, "mount": MOUNT, "axis": AXIS}, body))
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
def test_curves_end_at_the_tip(effects):
    """The tip that effects shorten too; the links of a plane stay in it."""
    lin = linear(scene_of(BEAM, {"length": 0.5, "mass_per_length": 1.0, "axis": [0, 1, 0]}, **effects))
    t, states = np.array([0.0, 0.3]), 0.05 * np.random.default_rng(0).normal(size=(2, lin.n))
    tips = lin.about.of_arm("points", t, states)[:, :, -1]
    for (first, second), tip in zip(trace_arm(lin, t, states), tips, strict=True):
        assert first.shape == second.shape == (3, COLUMNS)
        np.testing.assert_allclose(second[:, -1], tip, rtol=0, atol=1e-14)
        chord = first[:, -1] - first[:, 0]
        assert np.linalg.norm(np.cross(first[:, 9] - first[:, 0], chord)) > 1e-3
    flat = linear(scene_of({**BEAM, "modes": 2}))
    assert trace_arm(flat, t, states[:, :3])[0][0].shape == (2, COLUMNS)
