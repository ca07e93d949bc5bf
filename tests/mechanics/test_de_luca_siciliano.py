"""The two-link arm of De Luca, Siciliano (1991): printed frequencies, and the kinetic energy integrated without the chain."""

import numpy as np
import pytest

from flexlin.mechanics import build_manipulator, clamped_with_tip, make_shapes, sum_carried
from flexlin.scene import load_scene

from .scenes import value

LENGTH, DENSITY = 0.5, 0.2


@pytest.fixture(scope="module")
def scene():
    return load_scene("de-luca-siciliano-1991")


def test_what_link_1_carries(scene):
    """Hub 1 kg, link 0.1 kg, payload 0.1 kg; the paper's 1.2 kg and 0.133833 kg m^2."""
    np.testing.assert_allclose(sum_carried(scene, 0), (1.2, 0.133833), rtol=3e-6)
    np.testing.assert_allclose(sum_carried(scene, 1), (0.1, 5e-4), rtol=1e-15)


def test_printed_frequencies(scene):
    for link, printed in enumerate(([0.48, 1.80], [2.18, 15.91])):
        omega = make_shapes(scene, link).beta ** 2 * np.sqrt(1.0 / (DENSITY * LENGTH**4))
        np.testing.assert_allclose(omega / (2 * np.pi), printed, atol=0.005)


def independent_kinetic_energy(q2, rates):
    """T at zero deflection from positions of material points, by Gauss quadrature: no frames, no moments, no chain."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    xi, weight = (nodes + 1) / 2, weights / 2 * DENSITY * LENGTH
    one = clamped_with_tip(2, 1.2 / 0.1, 0.13383333333333333 / (DENSITY * LENGTH**3))
    two = clamped_with_tip(2, 0.1 / 0.1, 5e-4 / (DENSITY * LENGTH**3))
    (r1, r2), v1, v2, end = rates[:2], rates[2:4], rates[4:], np.ones(1)

    first = np.stack([np.zeros(80), LENGTH * xi * r1 + v1 @ one.values(xi)])
    elbow = np.array([0.0, LENGTH * r1 + v1 @ one.values(end)[:, 0]])
    turn_before = r1 + v1 @ one.values(end, 1)[:, 0] / LENGTH
    turn = turn_before + r2
    across = np.array([-np.sin(q2), np.cos(q2)])
    second = elbow[:, None] + np.outer(across, LENGTH * xi * turn + v2 @ two.values(xi))
    tip = elbow + across * (LENGTH * turn + v2 @ two.values(end)[:, 0])
    tip_turn = turn + v2 @ two.values(end, 1)[:, 0] / LENGTH
    energy = (first**2).sum(axis=0) @ weight + (second**2).sum(axis=0) @ weight
    energy += 1.0 * elbow @ elbow + 0.1 * tip @ tip  # the hub on joint 2, the payload
    return (energy + 0.1 * r1**2 + 0.1 * turn**2 + 5e-4 * tip_turn**2) / 2


@pytest.mark.slow
@pytest.mark.parametrize("q2", [0.0, 0.7, -2.0])
def test_mass_matrix_is_the_integrated_kinetic_energy(scene, q2):
    arm = build_manipulator(scene)
    M = value(arm, "M", np.array([0.4, q2, 0, 0, 0, 0]))
    basis = np.eye(6)
    energy = [[independent_kinetic_energy(q2, a + b) for a in basis] for b in basis]
    alone = np.array([independent_kinetic_energy(q2, a) for a in basis])
    np.testing.assert_allclose(M, np.array(energy) - alone[:, None] - alone, atol=1e-10 * np.abs(M).max())
    np.testing.assert_allclose(M, M.T, atol=1e-14)
    assert np.linalg.eigvalsh(M).min() > 0
