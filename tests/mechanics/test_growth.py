"""The recursion over links: instructions grow no faster than the square of the coordinates."""

import numpy as np
import pytest

import flexlin as fl

from .scenes import scene_of

EFFECTS = {"gravity": {}, "payload": {"mass": 0.1}, "geometric_stiffening": {}, "modal_damping": {"ratio": 0.01}}


def instructions(links, modes):
    scene = scene_of(*[{"modes": modes}] * links, effects=EFFECTS)
    arm = fl.build_manipulator(scene)
    lin = fl.linearize(arm, scene.motion)
    return arm.n, arm.functions["residual"].n_instructions(), lin.coefficients.n_instructions()


def exponent(sizes, counts):
    return np.polyfit(np.log(sizes), np.log(counts), 1)[0]


def test_growth_with_the_number_of_links():
    """Linear for the residual; square for the matrices, which have that many entries."""
    n, residual, matrices = zip(*[instructions(links, 2) for links in (2, 3, 4, 6)], strict=True)
    assert exponent(n, residual) < 1.3
    assert exponent(n, matrices) < 2.4


@pytest.mark.parametrize("links", [1, 2])
def test_growth_with_the_number_of_modes(links):
    """Square: the shortening's quadratic forms have modes^2 entries."""
    n, residual, matrices = zip(*[instructions(links, modes) for modes in (3, 6, 12)], strict=True)
    assert exponent(n, residual) < 2.1
    assert exponent(n, matrices) < 2.4
