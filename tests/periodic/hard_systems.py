"""The systems of the hard cases, and exponents of theirs from elsewhere."""

import numpy as np

import flexlin as fl
from tests.closed_arm import closed
from tests.periodic.chains import TWO_PI, Real
from tests.periodic.systems import lyapunov_transformed
from tests.periodic.truths import integrated, panels_of


def transformed(exponents, periods=1.0, seed=1):
    A = lyapunov_transformed(np.diag(exponents), 1.0, 1, np.random.default_rng(seed))
    return fl.PeriodicSystem(A, 2 * np.pi * periods)


def gyroscopic(stiffness, spin):
    """y'' + 2 spin J y' - stiffness y = 0: z^2 + (4 spin^2 - 2 stiffness) z + stiffness^2 = 0 for z = lambda^2."""
    J = np.array([[0, 1.0], [-1, 0]])
    return fl.PeriodicSystem.from_second_order(np.eye(2), 2 * spin * J, -stiffness * np.eye(2), 1.7)


def gyroscopic_exponents(stiffness, spin):
    z = np.roots([1, 4 * spin**2 - 2 * stiffness, stiffness**2]).astype(complex)
    return np.concatenate([np.sqrt(z), -np.sqrt(z)])


def link(**changes):
    """The closed loop of the built-in single link, with changed numbers."""
    paths = {path.replace("__", "."): value for path, value in changes.items()}
    return closed(changes={"designs": [], **paths}).periodic_system()


def hill_exponents(system):
    return fl.floquet(system, tol=1e-7, method="hill").exponents


FREQUENCIES = 1.0 * np.arange(1, 41) ** 2
"""In rad/s, spaced like a beam's bending frequencies."""
SHAPES = np.linalg.qr(np.random.default_rng(8).standard_normal((40, 40)))[0]


def modulated(stiffness, damping):
    n = len(stiffness)
    return fl.PeriodicSystem.from_second_order(
        np.eye(n), damping, lambda t: (1 + 0.02 * np.cos(200 * t))[:, None, None] * stiffness, np.pi / 100
    )


def forty_modes():
    """Forty oscillators, damped in proportion to their stiffness and modulated together, seen in mixed coordinates."""
    stiffness = SHAPES.T @ np.diag(FREQUENCIES**2) @ SHAPES
    return modulated(stiffness, 1e-3 * stiffness)


def forty_modes_one_by_one():
    return np.concatenate(
        [fl.floquet(modulated(w * w * np.eye(1), 1e-3 * w * w * np.eye(1)), tol=1e-11).exponents for w in FREQUENCIES]
    )


def turning_link():
    """A rigid link under weak feedback whose joint has dry friction; loops of CasADi name their turn-arounds themselves."""
    return loop_of(
        {
            "schema": 1,
            "title": "dry friction",
            "links": [{"length": 0.5, "mass_per_length": 0.4, "modes": 0}],
            "effects": {"coulomb_friction": {"torque": [0.02], "rate": 0.001}},
            "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"mean": 0.0, "amplitude": 0.5}]},
            "control": {"feedback": {"kind": "pd", "kp": [0.2], "kd": [0.001]}},
        }
    )


def turning_link_exponents():
    """The same in extended precision: J y'' + (kd + c / eps sech^2(q' / eps)) y' + kp y = 0, J = 1 / 60 kg m^2, q' = pi cos(2 pi t)."""
    J, kp, kd, c, eps = (Real(value) for value in ("0.05", "0.2", "0.001", "0.02", "0.001"))
    J = J / 3

    def A(t):
        shape = np.cosh(np.minimum(np.abs(TWO_PI / 2 * np.cos(TWO_PI * t) / eps), Real(300))) ** -2
        values = np.zeros((len(t), 2, 2), Real)
        values[:, 0, 1], values[:, 1, 0], values[:, 1, 1] = 1, -kp / J, -(kd + c / eps * shape) / J
        return values

    return integrated(A, panels_of(1.0, 20.0, (), [(turn, 0.004, 300) for turn in (0.25, 0.75)]), 1.0).exponents


def loop_of(raw):
    """The periodic system of a scene's own loop."""
    scene = fl.parse_scene(raw)
    return fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control).periodic_system()


def near_singular_mass():
    M = np.array([[1.0, 1 - 1e-10], [1 - 1e-10, 1.0]])
    return fl.PeriodicSystem.from_second_order(M, 1e-3 * M + 1e-8 * np.eye(2), np.eye(2), 2.0)


def near_singular_mass_exponents():
    masses = np.array([1 + (1 - 1e-10), 1 - (1 - 1e-10)])  # of the matrix as it is stored
    return np.concatenate([np.roots([m, 1e-3 * m + 1e-8, 1.0]) for m in masses])


def long_oscillator(damping):
    return fl.PeriodicSystem.from_second_order(
        np.eye(1), [[damping]], lambda t: (7.0 + np.cos(2 * t))[:, None, None], 1200 * np.pi
    )


def short_oscillator_exponents(damping):
    short = fl.PeriodicSystem.from_second_order(
        np.eye(1), [[damping]], lambda t: (7.0 + np.cos(2 * t))[:, None, None], np.pi
    )
    return fl.floquet(short, tol=1e-13).exponents
