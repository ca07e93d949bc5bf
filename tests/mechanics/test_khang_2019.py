"""Khang, Dat, Tuan (2019), Eqs (68)-(71), entry by entry, from the scene's effects and from the hand-typed matrices alike."""

import numpy as np
import pytest
from scipy.integrate import quad

import flexlin as fl

from .scenes import clamped_mode, swinging

L, RHO_A, EI, J1, M_E, G = 1.3, 0.3, 2.0, 0.05, 0.1, 9.81
FREQUENCY, AMPLITUDE, MEAN = 0.7, 0.6, 0.2


MOTION = swinging({"amplitude": AMPLITUDE, "mean": MEAN}, frequency=FREQUENCY)


def paper(q, q1, q2):
    """M_L, K_L, h_L (with tau = 0) as printed, with X1 read as X1(l) and mu as rhoA (errata of (68), (69), (71))."""

    def integral(f):
        return quad(lambda x: f(x, clamped_mode(x / L)), 0, L, epsabs=1e-13)[0]

    C1, D1, m11 = integral(lambda x, X: X), integral(lambda x, X: x * X), integral(lambda x, X: X**2)
    k11 = integral(lambda x, _: (clamped_mode(x / L, 2) / L**2) ** 2)
    X, m_OE = clamped_mode(1), RHO_A * L
    m12, inertia = M_E * L * X + RHO_A * D1, J1 + M_E * L**2 + m_OE * L**2 / 3
    M = [[inertia, m12], [m12, M_E * X**2 + RHO_A * m11]]
    k12, bending = -(M_E * X + RHO_A * C1) * G * np.sin(q), -M_E * q1**2 * X**2 - RHO_A * q1**2 * m11 + EI * k11
    K = [[-(M_E + m_OE / 2) * G * L * np.sin(q), k12], [k12, bending]]
    h = [-inertia * q2 - (M_E + m_OE / 2) * G * L * np.cos(q), -m12 * q2 - (M_E * X + RHO_A * C1) * G * np.cos(q)]
    return np.array(M), np.array(K), np.array(h)


def scene_of(way, modes=1):
    """The arm from the scene's effects, or by the paper's matrices."""
    links = [{"length": L, "mass_per_length": RHO_A, "bending_stiffness": EI, "modes": modes}]
    own = {"links": links, "hub_inertia": J1, "payload_mass": M_E, "gravity": G}
    effects = {"hub": {"inertia": J1}, "payload": {"mass": M_E}, "gravity": {"acceleration": G}}
    by_hand = {"model": "khang-2019", "parameters": own}
    arm = by_hand if way == "by hand" else {"links": links, "effects": effects}
    return fl.parse_scene({"schema": 1, "title": way, "motion": MOTION, **arm})


@pytest.mark.parametrize("route", ["jacobian", "kronecker"])
@pytest.mark.parametrize("way", ["from effects", "by hand"])
def test_printed_equations(way, route):
    scene = scene_of(way)
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, route=route)
    t = np.linspace(0.0, lin.period, 9)[:-1]
    angle = 2 * np.pi * FREQUENCY * t
    q, q1 = MEAN + AMPLITUDE * np.sin(angle), AMPLITUDE * 2 * np.pi * FREQUENCY * np.cos(angle)
    q2 = -AMPLITUDE * (2 * np.pi * FREQUENCY) ** 2 * np.sin(angle)
    M, K, h = (np.array(part) for part in zip(*map(paper, q, q1, q2), strict=True))
    np.testing.assert_allclose(lin.M(t), M, rtol=1e-12)
    np.testing.assert_allclose(lin.K(t), K, rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(lin.D(t), 0.0, atol=1e-15)  # Eq. (70)
    np.testing.assert_allclose(lin.h(t), h, rtol=1e-12)
    np.testing.assert_allclose(lin.B(t), np.broadcast_to([[1.0], [0.0]], (len(t), 2, 1)))


@pytest.mark.parametrize("modes", [0, 3, 12])
def test_several_modes_by_hand_are_those_of_the_chain(modes):
    """Felgar's integrals in closed form against quadrature, sums over modes against the chain's energies, at random states."""
    own, chain = (fl.build_manipulator(scene_of(way, modes)) for way in ("by hand", "from effects"))
    assert own.names == chain.names
    rng = np.random.default_rng(modes)
    s, s_dot, s_ddot = rng.normal(size=(3, 1 + modes)) * np.array([1.0, *[0.1] * modes])
    for name, state in (("M", [s]), ("C", [s, s_dot]), ("g", [s]), ("residual", [s, s_dot, s_ddot]), ("points", [s])):
        ours, theirs = (np.array(arm.functions[name](*state, [])) for arm in (own, chain))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max(), err_msg=name)
