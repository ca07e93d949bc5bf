"""Instructions of the equations: no more than a planar code has, and square in the places of a curve."""

import pytest

import flexlin as fl
from flexlin.scene import builtin_scenes
from studies.scaling import scene_of as chain_of

from .scenes import scene_of

EFFECTS = {"gravity": {}, "payload": {"mass": 0.1}, "geometric_stiffening": {}, "modal_damping": {"ratio": 0.01}}


PLANAR = {  # instructions of the residual and of (M, D, K, h) when frames and moments knew the plane only
    (1, 2): (498, 272),
    (2, 2): (1200, 1877),
    (3, 3): (3186, 7707),
    (6, 1): (2184, 12444),
    "de-luca-siciliano-1991": (1123, 1739),
    "pick-and-place": (973, 1893),
    "quanser-flexible-link": (150, 92),
    "rigid-flexible-forearm": (419, 472),
    "rotating-beam": (1112, 242),
    "single-link": (499, 271),
    "three-link": (1088, 2993),
}


@pytest.mark.parametrize("name", PLANAR, ids=str)
def test_a_planar_arm_costs_what_a_planar_code_costs(name):
    """Frames and moments are spatial; what never leaves the plane has no entries, and so no instructions."""
    scene = fl.load_scene(builtin_scenes()[name]) if isinstance(name, str) else chain_of(*name)
    arm = fl.build_manipulator(scene)
    lin = fl.linearize(arm, scene.motion, scene.control)
    counts = arm.near.functions["residual"].n_instructions(), lin.coefficients.n_instructions()
    assert counts[0] <= 1.05 * PLANAR[name][0]
    assert counts[1] <= 1.05 * PLANAR[name][1]
    assert arm.points.shape[0] == 2


CURVED = {1: 800, 2: 1200, 4: 2300, 6: 4300}
"""The same of the residual at any deflection, by modes: some ten for each pair of places."""


@pytest.mark.parametrize("modes", CURVED)
def test_a_curve_costs_the_square_of_its_places(modes):
    """2 n + 6 places: fewer instructions than the second order of many modes with its Coriolis terms, and square in n."""
    arm = fl.build_manipulator(scene_of({"modes": modes}, effects=EFFECTS))
    assert arm.functions["residual"].n_instructions() < CURVED[modes]
