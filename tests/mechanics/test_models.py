"""Published arms: Khang, Dat, Tuan (2019), entry by entry; the numbers of shipped scenes come back out of them, each a sound system."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import eigh

import flexlin as fl
from flexlin.mechanics import make_shapes, sum_carried

from .scenes import clamped_mode, matrices_at_rest, swinging

SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("manutec-r3", "puma-560", "spatial-arm")]


@pytest.mark.parametrize("name", ["de-luca-siciliano-1991", "flexible-joint-link", "rigid-flexible-forearm", *SLOW])
def test_their_own_loops_are_stable(name):
    scene = fl.load_scene(name)
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    assert fl.floquet(lin.periodic_system(), tol=1e-6).verdict == "stable"


def test_forearm_has_its_measured_frequencies_and_inertias():
    """l = 0.3, 0.7 m; J = 0.447, 0.303 kg m^2; 4.716 and 14.395 Hz with the forearm's hub free (De Luca et al. 1990)."""
    scene = fl.load_scene("rigid-flexible-forearm")
    assert [link.length for link in scene.links] == [0.3, 0.7]
    M, K = matrices_at_rest(fl.build_manipulator(scene))
    M, K = M[1:, 1:], K[1:, 1:]
    assert M[0, 0] == pytest.approx(0.303, rel=1e-6)
    hertz = np.sqrt(np.abs(eigh(K, M, eigvals_only=True))) / (2 * np.pi)
    np.testing.assert_allclose(hertz[1:], [4.716, 14.395], rtol=1e-5)


def test_flexible_joint_has_its_frequency():
    """Motor locked: sqrt(k / J) with k = 1.3 N m/rad, J = 0.064 kg (0.298 m)^2 / 3."""
    M, K = matrices_at_rest(fl.build_manipulator(fl.load_scene("flexible-joint-link")))
    assert np.sqrt(K[0, 0] / M[0, 0]) == pytest.approx(np.sqrt(1.3 * 3 / 0.064) / 0.298, rel=1e-5)


def test_what_link_1_carries():
    """Hub 1 kg, link 0.1 kg, payload 0.1 kg; the paper's 1.2 kg and 0.133833 kg m^2."""
    scene = fl.load_scene("de-luca-siciliano-1991")
    np.testing.assert_allclose(sum_carried(scene, 0), (1.2, 0.133833), rtol=3e-6)
    np.testing.assert_allclose(sum_carried(scene, 1), (0.1, 5e-4), rtol=1e-15)


def test_printed_frequencies():
    scene = fl.load_scene("de-luca-siciliano-1991")
    for link, printed in enumerate(([0.48, 1.80], [2.18, 15.91])):
        omega = make_shapes(scene, link).beta ** 2 * np.sqrt(1.0 / (0.2 * 0.5**4))
        np.testing.assert_allclose(omega / (2 * np.pi), printed, atol=0.005)


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
