"""The nonlinear flow around the rigid motion, differentiated by differences, against the transition matrix of the linear equations."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.periodic import choose_setting, factor_period
from flexlin.scene import parse_scene

BEAM = {"length": 0.7, "mass_per_length": 0.6, "bending_stiffness": [9.0, 14.0]}
SWINGS = [(0.2, 0.4, 0.0), (0.4, 0.3, 1.1)]
FREQUENCY, STATES = 1.0, 18
KP, KD = np.array([30.0, 20.0]), np.array([5.0, 3.0])
SCENE = {
    "schema": 1,
    "title": "flexible joints and links in space",
    "links": [
        {
            **BEAM,
            "mount": {"rpy": [0.3, -0.2, 0.1]},
            "modes": {"y": 1, "z": 1, "torsion": 1},
            "torsional_stiffness": 4.0,
            "polar_inertia": 0.004,
            "body": {"mass": 0.8, "centre": [0.05, 0.02, -0.03], "inertia": {"xx": 0.02, "yy": 0.03, "zz": 0.03}},
        },
        {**BEAM, "axis": [0.3, 1.0, -0.2], "mount": {"xyz": [0.0, 0.03, 0.05], "rpy": [0.4, 0.0, 0.0]}, "modes": {"y": 1, "z": 1}},
    ],
    "effects": {
        "gravity": {"direction": [0.1, -0.2, -1.0]},
        "payload": {"mass": 0.4, "centre": [0.03, 0.0, 0.02], "tensor": {"xx": 0.002, "yy": 0.003, "zz": 0.004}},
        "geometric_stiffening": {},
        "bending_torsion_coupling": {},
        "modal_damping": {"ratio": 0.05},
        "joint_flexibility": {"stiffness": [90.0, 60.0], "motor_inertia": [0.4, 0.2], "damping": [0.05, 0.03]},
        "rotor_spin": {"inertia": 3e-4, "gear_ratio": 60.0},
        "viscous_friction": {"coefficient": [0.2, 0.1]},
    },
    "motion": {
        "kind": "harmonic",
        "frequency": FREQUENCY,
        "joints": [{"mean": m, "amplitude": a, "phase": p} for m, a, p in SWINGS],
    },
    "control": {"feedforward": "rigid", "feedback": {"kind": "pd", "kp": KP.tolist(), "kd": KD.tolist()}},
}  # fmt: skip


class Flow:
    """The nonlinear equations under the motors' own feedback, with the forces that make the rigid motion one of their solutions."""

    def __init__(self, arm):
        zero, state = np.zeros(arm.n), [arm.s, arm.s_dot]
        bias = ca.substitute(arm.residual, arm.s_ddot, zero)
        at_one = ca.Function("equations", state, [ca.densify(arm.M), ca.densify(bias)])
        self.n, self.equations = arm.n, at_one.map(4 * arm.n + 1)
        self.motors = [arm.names.index(f"theta{i + 1}") for i in range(2)]

    def rigid(self, t):
        """Joints and motors swing, nothing bends: s, s', s'' by hand."""
        mean, size, phase = np.array(SWINGS).T
        w = 2 * np.pi * FREQUENCY
        rows = np.zeros((3, self.n))
        for row, factor, angle in zip(rows, (1, w, -(w**2)), (np.sin, np.cos, np.sin), strict=True):
            row[:2] = row[self.motors] = factor * size * angle(w * t + phase) + (mean if factor == 1 else 0)
        return rows

    def rates(self, t, states):
        """x' of many states (2n, N) at once."""
        s, v = states[: self.n], states[self.n :]
        count, (s_r, v_r, a_r) = states.shape[1], self.rigid(t)
        values = self.equations(np.column_stack([s, s_r]), np.column_stack([v, v_r]))
        M = np.array(values[0]).reshape(self.n, count + 1, self.n).transpose(1, 0, 2)
        bias = np.array(values[1]).T
        force = np.tile(M[-1] @ a_r + bias[-1], (count, 1))
        for motor, kp, kd in zip(self.motors, KP, KD, strict=True):
            force[:, motor] -= kp * (s[motor] - s_r[motor]) + kd * (v[motor] - v_r[motor])
        return np.vstack([v, np.linalg.solve(M[:-1], (force - bias[:-1])[..., None])[..., 0].T])

    def monodromy(self, period, scales, step):
        """Central differences of the state after a period by that before it, in scaled states, with one step control for all."""
        start = np.concatenate(self.rigid(0.0)[:2])
        moves = step * np.hstack([np.diag(scales), -np.diag(scales)])
        begin = start[:, None] + moves
        run = solve_ivp(
            lambda t, x: self.rates(t, x.reshape(begin.shape)).ravel(),
            (0.0, period),
            begin.ravel(),
            method="DOP853",
            rtol=1e-8,
            atol=1e-8,
        )
        end = run.y[:, -1].reshape(begin.shape)
        half = begin.shape[1] // 2
        return (end[:, :half] - end[:, half:]) / (2 * step) / scales[:, None]


@pytest.mark.slow
def test_floquets_transition_matrix_is_that_of_the_nonlinear_flow():
    scene = parse_scene(SCENE)
    arm = fl.build_manipulator(scene)
    system = fl.linearize(arm, scene.motion, scene.control).periodic_system()
    assert 2 * arm.n == STATES
    scales = np.concatenate([np.ones(arm.n), np.full(arm.n, 10.0)])
    flow = Flow(arm)
    found = flow.monodromy(system.period, scales, 1e-5)
    _, factors = factor_period(system, choose_setting(system, 1e-10, "auto", None, None))
    expected = np.linalg.multi_dot(factors[::-1]) * scales / scales[:, None]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    result = fl.floquet(system)
    own = np.linalg.eigvals(found)
    distance = np.abs(own[:, None] - result.multipliers).min(axis=1).max()
    assert distance < 1e-6 * np.abs(own).max()
