"""A two-link arm in space against rigid segments with finite rotations between them, entry by entry: M, D, K, h along a motion.

Each link is cut into N rigid segments; at each of the N middles the section turns by exp(h kappa~), kappa = (phi', -w'', v'') from the same
coordinates, and all that follows turns with it. Kinetic energy of point masses and discs, potential energy of weight and springs:
nothing is expanded, and nothing of flexlin is used but the shapes themselves. The error falls with N squared.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.mechanics import make_shapes
from flexlin.scene import parse_scene

LINK = {
    "length": 0.9,
    "mass_per_length": 0.8,
    "bending_stiffness": [60.0, 25.0],
    "torsional_stiffness": 18.0,
    "polar_inertia": 0.004,
    "modes": {"y": 1, "z": 1, "torsion": 1},
}
OTHER = {**LINK, "length": 0.7, "bending_stiffness": [9.0, 14.0], "axis": [0.3, 1.0, 0.2]}
MOUNT = {"xyz": [0.05, -0.1, 0.02], "rpy": [0.4, -0.3, 0.6]}
PAYLOAD = {"mass": 0.4, "centre": [0.06, 0.03, -0.04], "tensor": {"xx": 0.01, "yy": 0.02, "zz": 0.015, "xz": 0.004}}
GRAVITY = {"acceleration": 9.81, "direction": [0.2, -0.3, -1.0]}
SCENE = parse_scene(
    {
        "schema": 1,
        "title": "two links in space",
        "links": [{**LINK, "axis": [0, 0, 1]}, {**OTHER, "mount": MOUNT}],
        "effects": {"gravity": GRAVITY, "payload": PAYLOAD, "geometric_stiffening": {}, "bending_torsion_coupling": {}},
        "motion": {
            "kind": "harmonic",
            "frequency": 0.8,
            "joints": [{"mean": 0.2, "amplitude": 0.7}, {"mean": 0.5, "amplitude": 0.6, "phase": 1.0}],
        },
    }
)


@dataclass
class Moving:
    """A matrix that changes in time, and its rate."""

    value: ca.SX
    rate: ca.SX

    def __matmul__(self, other):
        if not isinstance(other, Moving):
            return Moving(self.value @ other, self.rate @ other)
        return Moving(self.value @ other.value, self.rate @ other.value + self.value @ other.rate)

    def __add__(self, other):
        return Moving(self.value + other.value, self.rate + other.rate)


def turn(vector, small=False):
    """exp(vector~); near zero by its series, exact to the sixth order."""
    x = ca.vertcat(*vector) if isinstance(vector, list) else vector
    K, square = ca.skew(x), ca.sumsqr(x)
    if small:
        return ca.SX.eye(3) + (1 - square / 6 + square**2 / 120) * K + (0.5 - square / 24 + square**2 / 720) * K @ K
    angle = ca.sqrt(square)
    return ca.SX.eye(3) + ca.sin(angle) / angle * K + (1 - ca.cos(angle)) / square * K @ K


def segments(count):
    """M, D, K, h of the segments' Lagrangian at a time of the motion."""
    q, w = ca.SX.sym("q", 2), [ca.SX.sym(f"w{i}", 3) for i in range(2)]
    s = ca.vertcat(q, *w)
    rate, b = ca.SX.sym("rate", 8), ca.SX.sym("b", 8)
    R, p, T, V = Moving(ca.SX.eye(3), ca.SX.zeros(3, 3)), Moving(ca.SX.zeros(3), ca.SX.zeros(3)), ca.SX(0), ca.SX(0)

    def moving(expression):
        return Moving(expression, ca.jtimes(expression, s, rate))

    down = np.array(GRAVITY["direction"]) / np.linalg.norm(GRAVITY["direction"])

    def add_mass(mass, place, spread=None, rotation=None):
        nonlocal T, V
        T, V = T + mass * ca.sumsqr(place.rate) / 2, V - mass * 9.81 * ca.dot(ca.DM(down), place.value)
        if spread is not None:
            spin = rotation.value.T @ rotation.rate
            omega = ca.vertcat(spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]) / 2
            T = T + ca.dot(omega, spread @ omega) / 2

    for i, (table, elastic) in enumerate(zip((LINK, OTHER), w, strict=True)):
        if i == 1:
            roll, pitch, yaw = MOUNT["rpy"]
            p = p + R @ ca.DM(MOUNT["xyz"])
            for axis, angle in ((2, yaw), (1, pitch), (0, roll)):
                R = R @ turn(ca.DM(angle * np.eye(3)[axis]))
        own = np.array([0, 0, 1.0] if i == 0 else OTHER["axis"])
        R = R @ moving(turn(ca.DM(own / np.linalg.norm(own)) * q[i]))
        length, h = table["length"], table["length"] / count
        xi = (np.arange(count) + 0.5) / count
        bend = [make_shapes(SCENE, i, d).values(xi, 2)[0] / length**2 for d in ("y", "z")]
        twist = make_shapes(SCENE, i, "torsion").values(xi, 1)[0] / length
        polar = ca.diag(ca.DM([table["polar_inertia"] * h, 0, 0]))
        for k in range(count):
            kappa = ca.vertcat(twist[k] * elastic[2], -bend[1][k] * elastic[1], bend[0][k] * elastic[0])
            EI_y, EI_z = table["bending_stiffness"]
            V = V + h / 2 * (table["torsional_stiffness"] * kappa[0] ** 2 + EI_y * kappa[1] ** 2 + EI_z * kappa[2] ** 2)
            half = p + R @ ca.DM([h / 2, 0, 0])
            after = R @ moving(turn(h * kappa, small=True))
            p = half + after @ ca.DM([h / 2, 0, 0])
            mid = R @ moving(turn(h / 2 * kappa, small=True))
            # a segment's mass lies at its middle and, for the rod's own inertia, at its ends: Simpson's weights
            for place, share in ((half, 4.0), (p, 1.0), (half + R @ ca.DM([-h / 2, 0, 0]), 1.0)):
                add_mass(share / 6 * table["mass_per_length"] * h, place)
            add_mass(0.0, half, polar, mid)
            R = after
    J = PAYLOAD["tensor"]
    J = ca.DM([[J["xx"], 0, J["xz"]], [0, J["yy"], 0], [J["xz"], 0, J["zz"]]])
    add_mass(PAYLOAD["mass"], p + R @ ca.DM(PAYLOAD["centre"]), J, R)
    momentum = ca.gradient(T, rate)
    residual = ca.jtimes(momentum, ca.vertcat(s, rate), ca.vertcat(rate, b)) - ca.gradient(T - V, s)
    parts = [ca.densify(ca.jacobian(residual, x)) for x in (b, rate, s)]
    return ca.Function("segments", [s, rate, b], [*parts, -residual])


@pytest.mark.slow
def test_two_links_in_space_entry_by_entry():
    lin = fl.linearize(fl.build_manipulator(SCENE), SCENE.motion)
    assert lin.names == ("q1", "q2", "w11", "wz11", "phi11", "w21", "wz21", "phi21")
    t = 0.3
    states = [np.concatenate([part[0], np.zeros(6)]) for part in lin.motion.sample(np.array([t]))]
    coarse, middle, fine = ([np.array(x) for x in segments(count)(*states)] for count in (4, 8, 16))
    own = [lin.M(t), lin.D(t), lin.K(t), lin.h(t)[:, None]]
    for name, mine, *others in zip("MDKh", own, coarse, middle, fine, strict=True):
        limit = others[2] + (others[2] - others[1]) / 3
        errors = [np.abs(other - mine).max() for other in others]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.15), name
        assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.15), name
        np.testing.assert_allclose(mine, limit, rtol=0, atol=2e-5 * np.abs(mine).max(), err_msg=name)
