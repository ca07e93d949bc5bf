"""Synthetic logs: SciPy's integrator on the arm's own residual, which shares no step, grid or interpolation with what is tested."""

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

import flexlin as fl


def simulated(scene, time, torques, outputs, start=None):
    """Readings of `outputs` {name: expression of (arm)} under torques (time) -> (joints,), from a state [s; s']."""
    arm = fl.build_manipulator(scene)
    tau = ca.SX.sym("tau", arm.joints)
    left = ca.substitute(arm.residual, arm.s_ddot, ca.SX.zeros(arm.n)) - arm.B @ tau
    f = ca.Function("f", [arm.s, arm.s_dot, tau], [ca.vertcat(arm.s_dot, ca.solve(arm.M, -left))])

    def rate(t, x):
        return np.array(f(x[: arm.n], x[arm.n :], torques(t)))[:, 0]

    x0 = np.zeros(2 * arm.n) if start is None else start
    states = solve_ivp(rate, (time[0], time[-1]), x0, "DOP853", time, rtol=1e-7, atol=1e-9).y
    seen = ca.Function("seen", [arm.s, arm.s_dot], [ca.vertcat(*[one(arm) for one in outputs.values()])])
    values = np.array(seen.map(len(time))(states[: arm.n], states[arm.n :]))
    return dict(zip(outputs, values, strict=True)), states.T


def tip(axis):
    return lambda arm: arm.points[axis, -1]


def coordinate(name):
    return lambda arm: arm.s[arm.names.index(name)]


def swing(time, joints=1):
    """Torques of several frequencies, without symmetry."""
    return np.array([np.sin(3 * time + k) + 0.6 * np.sin(11 * time) + 0.4 * np.cos(23 * time) for k in range(joints)])
