"""Beams bent in two planes and twisted: known frequencies and loads."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

import flexlin as fl

from .scenes import held, linear, plain_scene

BEAM = {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0}


def scene_of(link, effects, rate=0.0):
    """One link that turns about z at a rate, or stands still."""
    turning = {"kind": "rotation", "joints": [{"rate": rate}], "drive": "prescribed"}
    return plain_scene([link], turning if rate else held(), effects=effects)


@pytest.mark.parametrize(("rate", "flap"), [(0.0, 3.5160), (2.0, 4.1373), (6.0, 7.3604), (12.0, 13.170)])
def test_rotating_blade(rate, flap):
    """Flap across the plane of rotation (Wright et al. 1982), lag in it: lag^2 = flap^2 - Omega^2; from one scene."""
    lin = linear(scene_of({**BEAM, "modes": {"y": 10, "z": 10}}, {"geometric_stiffening": {}}, rate))
    M, K = lin.M(0.0), lin.K(0.0)
    np.testing.assert_allclose(K[:10, 10:], 0, atol=1e-9)
    lag, flapping = (
        np.sqrt(eigh(K[part, part], M[part, part], eigvals_only=True)[0]) for part in (np.s_[:10], np.s_[10:])
    )
    assert flapping == pytest.approx(flap, rel=5e-5)
    assert lag == pytest.approx(np.sqrt(flapping**2 - rate**2), rel=1e-9)


@pytest.mark.parametrize("shapes", ["clamped-free", "clamped-loaded"])
@pytest.mark.parametrize("disc", [0.0, 0.3, 20.0])
def test_torsion_of_a_shaft_with_a_disc(disc, shapes):
    """omega tan(omega l / c) = GJ / (J c), c^2 = GJ / (rho I_p)."""
    length, stiffness, polar = 0.7, 3.0, 0.02
    link = {**BEAM, "length": length, "modes": {"torsion": 4}, "torsional_stiffness": stiffness, "polar_inertia": polar}
    tensor = {"payload": {"mass": 0.0, "tensor": {"xx": disc * polar * length}}} if disc else {}
    lin = linear(scene_of({**link, "mode_shapes": shapes}, tensor))
    found = np.sqrt(eigh(lin.K(0.0), lin.M(0.0), eigvals_only=True))
    c = np.sqrt(stiffness / polar)
    root = brentq(lambda x: x * np.sin(x) * disc - np.cos(x), 1e-6, np.pi / 2) if disc else np.pi / 2
    assert found[0] == pytest.approx(root * c / length, rel=1e-6)


@pytest.mark.slow
def test_lateral_buckling():
    """A clamped strip under a transverse load at its tip turns over at 4.0126 sqrt(EI_z GJ) / l^2 (Timoshenko, Gere)."""
    length, weak, twist = 1.3, 0.4, 0.25
    link = {
        **BEAM,
        "length": length,
        "mass_per_length": 1e-6,
        "bending_stiffness": [900.0, weak],
        "modes": {"y": 8, "z": 1, "torsion": 5},
        "torsional_stiffness": twist,
        "polar_inertia": 1e-6,
    }
    effects = {
        "gravity": {"direction": [0, 0, -1]},
        "payload": {"mass": 0.1},
        "geometric_stiffening": {},
        "bending_torsion_coupling": {},
    }
    scene = scene_of(link, effects)
    arm = fl.build_manipulator(scene, ["effects.payload.mass"])
    state = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)
    K = ca.Function("K", [state, arm.parameters.symbols], [ca.jacobian(arm.residual, arm.s)[1:, 1:]])

    def lowest(mass):
        return np.linalg.eigvalsh(np.array(K(np.zeros(3 * arm.n), mass))).min()

    load = 4.0126 * np.sqrt(weak * twist) / length**2
    assert lowest(0.9 * load / 9.81) > 0 > lowest(1.1 * load / 9.81)
    assert 9.81 * brentq(lowest, 0.9 * load / 9.81, 1.1 * load / 9.81) == pytest.approx(load, rel=1e-3)
