"""Rigid chains against Pinocchio: mass matrix, and derivatives of the inverse dynamics."""

import casadi as ca
import numpy as np
import pytest

from .scenes import arm_of, random_state, value

pin = pytest.importorskip("pinocchio", reason="flexlin[peers]")
pytestmark = pytest.mark.peers


def pinocchio_model(lengths, masses, gravity=9.81):
    """Slender rods on z-axis joints, built from Pinocchio's own parts."""
    model, parent, offset = pin.Model(), 0, 0.0
    model.gravity.linear = np.array([0.0, -gravity, 0.0])
    for i, (length, mass) in enumerate(zip(lengths, masses, strict=True)):
        place = pin.SE3(np.eye(3), np.array([offset, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{i}")
        inertia = np.diag([0.0, 1.0, 1.0]) * mass * length**2 / 12
        centre = np.array([length / 2, 0.0, 0.0])
        model.appendBodyToJoint(parent, pin.Inertia(mass, centre, inertia), pin.SE3.Identity())
        offset = length
    return model


@pytest.mark.parametrize("links", range(1, 7))
def test_rigid_chains(links):
    rng = np.random.default_rng(links)
    lengths, densities = rng.uniform(0.3, 1.0, links), rng.uniform(0.5, 2.0, links)
    tables = [{"length": a, "mass_per_length": b, "modes": 0} for a, b in zip(lengths, densities, strict=True)]
    arm = arm_of(*tables, effects={"gravity": {}})
    model = pinocchio_model(lengths, densities * lengths)
    data = model.createData()
    state = [arm.s, arm.s_dot, arm.s_ddot]
    jacobians = ca.Function("J", state, [ca.densify(ca.jacobian(arm.residual, x)) for x in state])
    for seed in range(5):
        q, rate, acceleration = random_state(arm, seed)
        torque = pin.rnea(model, data, q, rate, acceleration)
        np.testing.assert_allclose(value(arm, "residual", q, rate, acceleration)[:, 0], torque, rtol=1e-10, atol=1e-10)
        expected = pin.computeRNEADerivatives(model, data, q, rate, acceleration)
        M = np.triu(expected[2]) + np.triu(expected[2], 1).T
        for got, want in zip(jacobians(q, rate, acceleration), (expected[0], expected[1], M), strict=True):
            np.testing.assert_allclose(np.array(got), want, rtol=1e-10, atol=1e-10 * np.abs(want).max())
        np.testing.assert_allclose(value(arm, "M", q), M, rtol=1e-10)
