"""Khang, Dat, Tuan (2019), Eqs (68)-(71), entry by entry, from the scene's effects and from the hand-typed matrices alike."""

import numpy as np
import pytest
from scipy.integrate import quad

import flexlin as fl
from flexlin.scene import parse_scene

L, RHO_A, EI, J1, M_E, G = 1.3, 0.3, 2.0, 0.05, 0.1, 9.81
FREQUENCY, AMPLITUDE, MEAN = 0.7, 0.6, 0.2


def first_mode(x: float) -> float:
    """X = cosh - cos - sigma (sinh - sin) of a cantilever of length L. Source: Young, Felgar (1949), beta l = 1.87510407."""
    k = 1.8751040687119612 / L
    sigma = (np.cosh(k * L) + np.cos(k * L)) / (np.sinh(k * L) + np.sin(k * L))
    return np.cosh(k * x) - np.cos(k * x) - sigma * (np.sinh(k * x) - np.sin(k * x))


def second_derivative(x: float) -> float:
    k = 1.8751040687119612 / L
    sigma = (np.cosh(k * L) + np.cos(k * L)) / (np.sinh(k * L) + np.sin(k * L))
    return k**2 * (np.cosh(k * x) + np.cos(k * x) - sigma * (np.sinh(k * x) + np.sin(k * x)))


def paper(q, q1, q2):
    """M_L, K_L, h_L (with tau = 0) as printed, with X1 read as X1(l) and mu as rhoA (errata of (68), (69), (71))."""
    C1, D1, m11, k11 = (
        quad(f, 0, L, epsabs=1e-13)[0]
        for f in (
            first_mode,
            lambda x: x * first_mode(x),
            lambda x: first_mode(x) ** 2,
            lambda x: second_derivative(x) ** 2,
        )
    )
    X, m_OE = first_mode(L), RHO_A * L
    m12 = M_E * L * X + RHO_A * D1
    M = [[J1 + M_E * L**2 + m_OE * L**2 / 3, m12], [m12, M_E * X**2 + RHO_A * m11]]
    k12 = -M_E * G * X * np.sin(q) - RHO_A * G * np.sin(q) * C1
    K = [
        [-M_E * G * L * np.sin(q) - m_OE * G * L * np.sin(q) / 2, k12],
        [k12, -M_E * q1**2 * X**2 - RHO_A * q1**2 * m11 + EI * k11],
    ]
    h = [
        -(J1 + M_E * L**2 + m_OE * L**2 / 3) * q2 - M_E * G * L * np.cos(q) - m_OE * G * L * np.cos(q) / 2,
        -(M_E * L * X + RHO_A * D1) * q2 - M_E * G * X * np.cos(q) - RHO_A * G * np.cos(q) * C1,
    ]
    return np.array(M), np.array(K), np.array(h)


def motion() -> dict:
    return {"kind": "harmonic", "frequency": FREQUENCY, "joints": [{"amplitude": AMPLITUDE, "mean": MEAN}]}


def from_effects(modes=1):
    link = {"length": L, "mass_per_length": RHO_A, "bending_stiffness": EI, "modes": modes}
    effects = {"hub": {"inertia": J1}, "payload": {"mass": M_E}, "gravity": {"acceleration": G}}
    return parse_scene({"schema": 1, "title": "effects", "links": [link], "effects": effects, "motion": motion()})


def by_hand(modes=1):
    link = {"length": L, "mass_per_length": RHO_A, "bending_stiffness": EI, "modes": modes}
    own = {"links": [link], "hub_inertia": J1, "payload_mass": M_E, "gravity": G}
    return parse_scene({"schema": 1, "title": "by hand", "model": "khang-2019", "parameters": own, "motion": motion()})


@pytest.mark.parametrize("route", ["jacobian", "kronecker"])
@pytest.mark.parametrize("make", [from_effects, by_hand])
def test_printed_equations(make, route):
    scene = make()
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
    own, chain = (fl.build_manipulator(make(modes)) for make in (by_hand, from_effects))
    assert own.names == chain.names
    rng = np.random.default_rng(modes)
    s, s_dot, s_ddot = rng.normal(size=(3, 1 + modes)) * np.array([1.0, *[0.1] * modes])
    for name, state in (("M", [s]), ("C", [s, s_dot]), ("g", [s]), ("residual", [s, s_dot, s_ddot]), ("points", [s])):
        ours, theirs = (np.array(arm.functions[name](*state, [])) for arm in (own, chain))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max(), err_msg=name)
