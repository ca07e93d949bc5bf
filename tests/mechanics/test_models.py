"""The shipped scenes of chains: their sources' numbers come back out of them, and each makes a sound linear system."""

import numpy as np
import pytest
from scipy.linalg import eigh

import flexlin as fl
from flexlin.mechanics import make_shapes, sum_carried

from .scenes import matrices_at_rest

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
