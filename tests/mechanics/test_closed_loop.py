"""The 5-bar scene against the same two arms joined by Lagrange multipliers: no C_1, no C_2, no Taylor map."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin as fl
from flexlin.control import physical_weights
from flexlin.errors import FlexlinError, ModelError, ToleranceNotReached
from flexlin.mechanics import close_loop
from tests.mechanics.loop_scenes import raw

U = np.array([2.3, 1.05, 2e-3, -1e-3])
U_DOT = np.array([1.5, -2.0, 0.05, 0.1])
TAU = np.array([0.3, -0.7])


@pytest.fixture(scope="module")
def scene():
    return fl.load_scene("five-bar")


@pytest.fixture(scope="module")
def arm(scene):
    return fl.build_manipulator(scene)


@pytest.fixture(scope="module")
def joined(scene):
    """Accelerations of the unreduced arms, all four joints driven, with the constraint's multipliers."""
    table = raw("five-bar", designs=[], control={})
    del table["loops"]
    elbows = [i for i, link in enumerate(table["links"]) if link.pop("passive", False)]
    angles = [link.pop("posture") for link in table["links"]]
    table["motion"]["joints"] = [{"amplitude": 0.0}] * 4
    pair = fl.build_manipulator(fl.parse_scene(table))
    gap = pair.points[:, 2] - pair.points[:, -1]
    independent = [i for i in range(pair.n) if i not in elbows]
    s, s_dot = pair.s, pair.s_dot
    J = ca.jacobian(gap, s)
    rest = ca.substitute(pair.residual, pair.s_ddot, ca.SX.zeros(pair.n))
    table = ca.Function("open", [s, s_dot], [pair.M, rest, pair.B[:, [0, 2]], J, ca.jtimes(J @ s_dot, s, s_dot), gap])

    def configuration(u):
        s = np.zeros(pair.n)
        s[independent], s[elbows] = u, (angles[1], angles[3])
        for _ in range(10):
            *_, J, _, gap_now = (np.array(x) for x in table(s, np.zeros(pair.n)))
            s[elbows] -= np.linalg.solve(J[:, elbows], gap_now[:, 0])
        return s

    def acceleration(u, u_dot, tau):
        s = configuration(u)
        _, _, _, J, _, _ = (np.array(x) for x in table(s, np.zeros(pair.n)))
        s_dot = np.zeros(pair.n)
        s_dot[independent] = u_dot
        s_dot[elbows] = np.linalg.solve(J[:, elbows], -J @ s_dot)
        M, rest, B, J, bend, _ = (np.array(x) for x in table(s, s_dot))
        saddle = np.block([[M, -J.T], [J, np.zeros((2, 2))]])
        right = np.concatenate([B @ tau - rest[:, 0], -bend[:, 0]])
        return np.linalg.solve(saddle, right)[: pair.n][independent]

    return SimpleNamespace(pair=pair, gap=gap, acceleration=acceleration, configuration=configuration)


def test_acceleration_equals_that_with_multipliers(arm, joined):
    at = [U, U_DOT]
    M, B = (np.array(x) for x in ca.Function("f", [arm.s, arm.s_dot], [arm.M, arm.B]).call(at))
    rest = np.array(arm.functions["residual"](*at, np.zeros(4), []))[:, 0]
    assert_allclose(np.linalg.solve(M, B @ TAU - rest), joined.acceleration(U, U_DOT, TAU), rtol=1e-9)


def test_rate_of_M_minus_twice_C_is_skew(arm):
    rate = ca.reshape(ca.jtimes(ca.vec(arm.M), arm.s, arm.s_dot), 4, 4)
    S = np.array(ca.Function("S", [arm.s, arm.s_dot], [rate - 2 * arm.C])(U, U_DOT))
    assert_allclose(S, -S.T, atol=1e-9 * np.abs(S).max())


def test_loop_stays_closed_along_the_motion(arm, scene):
    """The left arm's way ends in the last link's tip, where the right one's does: the two tips are one."""
    lin = fl.linearize(arm, scene.motion)
    for q in lin.motion.sample(np.linspace(0, lin.period, 25))[0]:
        points = np.array(arm.functions["points"]([*q, 0, 0], []))
        assert np.abs(points[:, 2] - points[:, -1]).max() < 1e-12


def test_linearization_equals_differences_of_the_joined_arms(arm, joined, scene):
    """M a' = -K u - D u' - dM/ds (a - s_R'') u at constant torque; K_L holds dM/ds at the rigid acceleration s_R''."""
    lin = fl.linearize(arm, scene.motion)
    t = np.array([0.13])
    c = lin.sample(t)
    q, q1, q2 = (np.concatenate([x[0], [0, 0]]) for x in lin.motion.sample(t))
    difference = joined.acceleration(q, q1, c.tau[0]) - q2
    dM = np.array(ca.Function("dM", [arm.s], [ca.jacobian(arm.M @ ca.DM(difference), arm.s)])(q))

    def slope(moved, h=1e-5):
        columns = [8 * (moved(h * e) - moved(-h * e)) - moved(2 * h * e) + moved(-2 * h * e) for e in np.eye(4)]
        return np.array(columns).T / (12 * h)

    by_position = -c.M[0] @ slope(lambda e: joined.acceleration(q + e, q1, c.tau[0])) - dM
    by_rate = -c.M[0] @ slope(lambda e: joined.acceleration(q, q1 + e, c.tau[0]))
    assert_allclose(c.K[0], by_position, atol=1e-7 * np.abs(c.K[0]).max())
    assert_allclose(c.D[0], by_rate, atol=1e-7 * np.abs(c.D[0]).max())


@pytest.mark.slow
def test_floquet_and_lqr_as_for_any_arm(arm, scene):
    lin = fl.linearize(arm, scene.motion)
    design = scene.designs[0]
    gain = fl.periodic_lqr(lin.periodic_system(), *physical_weights(lin, design.weights), tol=1e-6)
    closed = fl.floquet(gain.closed_loop, tol=1e-6)
    assert fl.floquet(lin.periodic_system(), tol=1e-6).exponents.real.max() > -1e-3
    assert closed.verdict == "stable"
    assert closed.exponents.real.max() < -1


@pytest.mark.slow
def test_second_order_terms_by_the_series(arm):
    """r''[z, z] at a place of the motion, by fl.taylor in one variable and by CasADi."""
    z, t = np.array([0.3, -0.2, 1.0, 0.4]), ca.SX.sym("t")
    moved = ca.substitute(arm.residual, ca.vertcat(arm.s, arm.s_dot, arm.s_ddot), ca.vertcat(U + t * z, U_DOT, 0 * U))
    twice = ca.Function("twice", [t], [ca.jacobian(ca.jacobian(moved, t), t)])(0).full()
    assert_allclose(fl.taylor(moved, t, [0.0], 2).derivative(2), twice, rtol=1e-9)


def test_stiff_links_tend_to_rigid_ones(scene):
    """Statically, elastic coordinates follow w = K_ww^-1 h_w: the deflection falls like 1/EI."""
    deflections = []
    for stiffness in (3e2, 3e3, 3e4):
        changes = {f"links.{link}.bending_stiffness": stiffness for link in (1, 3)}
        stiff = fl.load_scene("five-bar", changes)
        c = fl.linearize(fl.build_manipulator(stiff), stiff.motion).sample(np.array([0.1]))
        deflections.append(np.abs(np.linalg.solve(c.K[0][2:, 2:], c.h[0][2:])).max())
    assert np.log10(np.divide(deflections[:-1], deflections[1:])) == pytest.approx([1, 1], abs=0.02)


@pytest.mark.slow
def test_a_motion_out_of_reach_is_refused(arm, scene):
    motion = scene.motion.model_copy(
        update={"joints": [j.model_copy(update={"amplitude": 3.0}) for j in scene.motion.joints]}
    )
    with pytest.raises(FlexlinError, match=r"posture.*got t = "):
        fl.linearize(arm, motion)


def test_an_impossible_posture_is_refused(joined):
    independent, posture = [0, 2, 4, 5], [2.2, -1.3, 0.95, 1.3, 0, 0]
    with pytest.raises(ToleranceNotReached, match="no solution"):
        close_loop(joined.pair, joined.gap + 1.0, independent, (0, 2), posture)
    with pytest.raises(ModelError, match="the motors' among them"):
        close_loop(joined.pair, joined.gap, [4, 0, 1, 5], (0, 2), posture)
