"""Properties of any chain: M symmetric and positive definite, power balance, Coriolis forces that belong to M, true velocities."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from .scenes import arm_of, random_state, value
from .test_effects import ON

LENGTHS = st.floats(0.2, 1.0)
LINKS = st.fixed_dictionaries(
    {
        "length": LENGTHS,
        "mass_per_length": st.floats(0.1, 1.0),
        "bending_stiffness": st.floats(0.5, 50.0),
        "modes": st.integers(0, 2),
        "mode_shapes": st.sampled_from(["clamped-free", "clamped-loaded", "pinned-free"]),
        "joint": st.sampled_from(["revolute", "revolute", "prismatic"]),
        "mount_angle": st.floats(-3.0, 3.0),
    }
)
FIRST_ONLY = {"hub": {"inertia": 0.02, "mass": 0.1}, "payload": {"mass": 0.1, "inertia": 0.001, "offset": 0.02}}
SCALAR = {
    "joint_flexibility": {"stiffness": 50.0, "motor_inertia": 0.05},
    "bearing_compliance": {"stiffness": 80.0, "damping": 0.3, "inertia": 0.02},
    "viscous_friction": {"coefficient": 0.2},
    "coulomb_friction": {"torque": 0.3, "rate": 0.05},
    "motor": {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": 50.0, "rotor_inertia": 1e-5},
    "rotor_spin": {"inertia": 1e-6, "gear_ratio": -40.0},
}
TABLES = ON | FIRST_ONLY | SCALAR


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    links=st.lists(LINKS, min_size=1, max_size=3),
    names=st.sets(st.sampled_from(sorted(TABLES))),
    seed=st.integers(0, 99),
)
def test_any_chain_obeys_mechanics(links, names, seed):
    arm = arm_of(*links, effects={name: TABLES[name] for name in names})
    s, s_dot, s_ddot = random_state(arm, seed, elastic=0.01)
    M = value(arm, "M", s)
    np.testing.assert_allclose(M, M.T, rtol=0, atol=1e-12 * np.abs(M).max())
    # The shortening of bent links is kept to second order, so with it M is a sum of squares about the straight arm only.
    bent = np.array([name.startswith("w") for name in arm.names])
    upright = value(arm, "M", np.where(bent, 0.0, s)) if "geometric_stiffening" in names else M
    assert np.linalg.eigvalsh(upright).min() > 0
    damping = value(arm, "damping", s, s_dot)[:, 0]
    assert "tip_force" in names or s_dot @ damping >= -1e-12
    residual = value(arm, "residual", s, s_dot, s_ddot)[:, 0]
    parts = M @ s_ddot + value(arm, "C", s, s_dot) @ s_dot + value(arm, "g", s)[:, 0] + damping
    np.testing.assert_allclose(residual, parts, rtol=0, atol=1e-10 * (1 + np.abs(residual).max()))
    state = ca.vertcat(arm.s, arm.s_dot)
    change = ca.jtimes(arm.energy, state, ca.vertcat(arm.s_dot, arm.s_ddot))
    rate = float(ca.Function("dE", [arm.s, arm.s_dot, arm.s_ddot], [change])(s, s_dot, s_ddot))
    power = s_dot @ (residual - damping)
    assert abs(rate - power) <= 1e-10 * (1 + np.abs(s_dot) @ np.abs(residual))
