"""A link that bends far in a plane or in both and twists, against rigid segments with finite rotations that share no code with it.

Segments e_k of a chain, cut at N springs, half a segment at both ends; a mass beside the tip's axis is one more vector on the last. With
int r'.r' dm = sum_jk a_jk e_j'.e_k' and polar inertias J_k, virtual work on angular velocities w_k gives

    sum_j e_k x a_kj (w_j' x e_j + w_j x (w_j x e_j)) + J_k ((w_k'.e_k) e_k + (w_k.e_k) w_k x e_k) = springs,

each spring with the rotation vector between its neighbours, V = 1/2 theta.K theta. The error falls with N squared.
Source: Wittbrodt, Adamiec-Wojcik, Wojciech, Dynamics of Flexible Multibody Systems (2006); rotation vectors: Simo, Vu-Quoc (1988).
"""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from flexlin.mechanics import bending_shapes

from .scenes import arm_of

EI_Y, EI_Z, GJ, MASS, POLAR = 2.0, 1.4, 0.8, 0.162, 4e-5
PAYLOAD, BESIDE = 0.08, np.array([0.0, 0.04, 0.02])
LINK = {"length": 1.0, "mass_per_length": MASS, "bending_stiffness": [EI_Y, EI_Z]}


LINK |= {"torsional_stiffness": GJ, "polar_inertia": POLAR, "modes": {"y": 6, "z": 6, "torsion": 2}}
PLANAR = {"length": 1.0, "mass_per_length": MASS, "bending_stiffness": EI_Z, "modes": 4}
FIRST = bending_shapes(1)


def cross(v, w):
    """v x w of vectors (..., 3): NumPy's takes longer than all the rest here."""
    return v[..., [1, 2, 0]] * w[..., [2, 0, 1]] - v[..., [2, 0, 1]] * w[..., [1, 2, 0]]


def skew(v):
    """v~ of vectors (..., 3)."""
    return cross(v[..., None, :], np.eye(3)).swapaxes(-1, -2)


def segment_form(length, mass, payload):
    """a (n, n) with T = 1/2 sum a_ij e_i'.e_j' of rigid segments: the lever l_i times (m_j / 2 + all beyond j) l_j."""
    beyond = np.append(np.cumsum(mass[::-1])[::-1][1:], 0.0) + payload
    a = np.triu(np.outer(length, length * (mass / 2 + beyond)), 1)
    return a + a.T + np.diag(length**2 * (mass / 3 + beyond))


def swing_segments(across, up, count, t, beside):
    """The tip (N, 3) of segments that hang on a hinge about z, let go from the first mode's slopes in both planes."""
    h, E = 1.0 / count, np.eye(3)
    length = np.r_[h / 2, np.full(count - 1, h), h / 2]
    a, bodies = segment_form(length, MASS * length, PAYLOAD), count + 1
    a = np.block([[a, PAYLOAD * length[:, None]], [PAYLOAD * length, PAYLOAD]])
    on = np.append(np.arange(bodies), bodies - 1)  # the body of each vector

    def sum_up(parts, axis=0):
        return np.add.reduceat(parts, range(bodies), axis)  # the last two are of one body

    springs = np.diag([GJ, EI_Y, EI_Z]) / h
    slope = FIRST.values(np.linspace(0, 1, bodies), 1)[0] / FIRST.values(np.ones(1))[0, 0]
    # Rz(v') Ry(-w') Rx(-int w' v''): no twist at the start
    turned = [slope * across, -slope * up, -(slope**2) * across * up / 2]
    start = Rotation.from_euler("ZYX", np.stack(turned, axis=1)).as_matrix()
    free = np.arange(3 * bodies) > 1  # the first segment turns about z alone

    def rates(_, x):
        R, w = x[: 9 * bodies].reshape(-1, 3, 3), x[9 * bodies :].reshape(-1, 3)
        e = np.concatenate([R[:, :, 0], (R[-1] @ beside)[None]])
        of, spin = w[on], np.sum(w * R[:, :, 0], axis=1)
        blocks = a[:, :, None, None] * ((e @ e.T)[:, :, None, None] * E - e[None, :, :, None] * e[:, None, None, :])
        M = sum_up(sum_up(blocks), 1).transpose(0, 2, 1, 3)
        M[range(bodies), :, range(bodies), :] += POLAR * length[:, None, None] * R[:, :, 0, None] * R[:, None, :, 0]
        pull = a @ cross(of, cross(of, e))
        force = -sum_up(cross(e, pull)) - (POLAR * length * spin)[:, None] * cross(w, R[:, :, 0])
        between = np.swapaxes(R[:-1], 1, 2) @ R[1:]
        theta = np.stack([between[:, j, i] - between[:, i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1) / 2
        sine = np.linalg.norm(theta, axis=1, keepdims=True) + 1e-300
        theta = theta * np.arcsin(sine) / sine
        K = skew(theta)
        moment = (E - K / 2 + K @ K / 12) @ (
            springs @ theta[:, :, None]
        )  # in the axes of the segment behind; to the fourth order
        moment = (R[1:] @ moment)[:, :, 0]
        force[1:] -= moment
        force[:-1] += moment
        found = np.zeros(3 * bodies)
        found[free] = np.linalg.solve(M.reshape(3 * bodies, -1)[np.ix_(free, free)], force.ravel()[free])
        return np.r_[(skew(w) @ R).ravel(), found]

    run = solve_ivp(rates, (0.0, t[-1]), np.r_[start.ravel(), np.zeros(3 * bodies)], "DOP853", t, rtol=1e-7, atol=1e-8)
    assert run.success
    return np.einsum("k,kxt->tx", length, run.y[: 9 * bodies].reshape(bodies, 3, 3, -1)[:, :, 0])


def swing(arm, start, t):
    """The tip (N, 2 or 3) and the energy of an arm that is let go at rest."""
    n = arm.n
    still = [ca.substitute(part, arm.s_ddot, 0) for part in (ca.jacobian(arm.residual, arm.s_ddot), arm.residual)]
    equations = ca.Function("equations", [arm.s, arm.s_dot], still)

    def rates(_, x):
        M, left = equations(x[:n], x[n:])
        return np.r_[x[n:], np.linalg.solve(M.full(), -left.full()[:, 0])]

    run = solve_ivp(rates, (0.0, t[-1]), np.r_[start, np.zeros(n)], "DOP853", t, rtol=1e-9, atol=1e-11)
    assert run.success
    energy = np.array([float(arm.functions["energy"](x[:n], x[n:], [])) for x in run.y.T])
    return np.array([arm.functions["points"](x[:n], []).full()[:, -1] for x in run.y.T]), energy


CASES = [("plane", 0.1, 0.005), ("plane", 0.25, 0.02), ("space", 0.25, 2e-3), ("beside", 0.25, 0.02)]


@pytest.mark.slow
@pytest.mark.parametrize(("way", "size", "missed"), CASES)
def test_a_link_swings_as_an_inextensible_curve(way, size, missed):
    """No hub, half the link's mass at its tip, or beside it: against segments by Richardson's rule.

    What is beside gives the tip a moment and a torque, which no shape of a free end has: these converge slowly, however little
    the link bends. With 16 shapes for 6 the linear motion from this start is another by 0.3 %.
    """
    across, up, beside = size * 0.8, size * 0.6, BESIDE * (way == "beside")
    link, t, first = LINK, np.linspace(0.0, 0.05, 6), 1 / FIRST.values(np.ones(1))[0, 0]
    effects = {"payload": {"mass": PAYLOAD, "centre": beside.tolist()}, "bending_torsion_coupling": {}}
    start = np.r_[0.0, across * first, np.zeros(5), up * first, np.zeros(7)]
    if way == "plane":
        across, up, link, effects = size, 0.0, PLANAR, {"payload": {"mass": PAYLOAD}}
        t, start = np.linspace(0.0, 0.15, 16), np.r_[0.0, across * first, np.zeros(3)]
    tip, energy = swing(arm_of(link, effects={"geometric_stiffening": {}, **effects}), start, t)
    coarse, fine = (swing_segments(across, up, count, t, beside) for count in (6, 12))
    exact = (fine + (fine - coarse) / 3)[:, : tip.shape[1]]
    assert np.abs(tip - exact).max() < missed * size
    assert np.ptp(energy) < 1e-8 * energy[0]
