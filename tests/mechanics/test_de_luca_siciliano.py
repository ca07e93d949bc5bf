"""The two-link arm of De Luca, Siciliano (1991): printed frequencies, and the kinetic energy integrated without the chain."""

import numpy as np
import pytest

from flexlin.mechanics import make_shapes, sum_carried
from flexlin.scene import load_scene

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
