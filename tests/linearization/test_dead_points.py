"""Loops near their dead points: no narrow feature goes unnamed, and where there is none fewer samples suffice."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.linearization import parametric_loop
from tests.mechanics.scenes import linear, plain_scene, swinging
from tests.thinned import thin


def stretched(gap):
    """A five-bar whose distal links come within `gap` of being stretched, at half the period; the rigid motion turns both bases alike.

    The distance of the elbows is base + 0.4 cos x, x = 0.9 sin(2 pi t / T); the dead point at 0.6 lies at x = i sqrt(5 gap).
    """
    base = {"parent": "base", "mount": {"xyz": [0.2 - gap, 0.0, 0.0]}}
    more = [{}, {"passive": True, "name": "left"}, base, {"passive": True, "name": "right"}]
    posture = [np.pi - 0.15, -2.87, 0.15, 2.87]
    bars = [{"length": 0.2 + 0.1 * (k % 2), "mass_per_length": 0.1, "posture": posture[k], **more[k]} for k in range(4)]
    motion = swinging({"mean": np.pi, "amplitude": 0.9, "phase": np.pi}, {"mean": 0.0, "amplitude": 0.9})
    return linear(plain_scene(bars, motion, loops=[{"link": "left", "to": "right"}]))


@pytest.mark.parametrize("gap", thin([0.02, 1e-4, 3e-4]))
def test_what_is_complete_is_right_between_its_samples(gap):
    lin = stretched(gap)
    width = np.arcsinh(np.sqrt(5 * gap) / 0.9) / (2 * np.pi)  # of the dead point from real times, in periods
    assert lin.complete == (width > 1 / 100)
    resolved = lin.periodic_system().resolved
    t = lin.period * np.concatenate([np.random.default_rng(1).random(2000), 0.5 + 1e-3 * np.linspace(-1, 1, 201)])
    exact = np.concatenate(lin.equations(t), axis=2)
    assert np.all(np.abs(resolved.series(t) - exact) <= 2 * resolved.error + 1e-15 * np.abs(exact).max(axis=0))


@pytest.mark.parametrize(("path", "followed"), [("motion.frequency", True), ("motion.joints.0.mean", False)])
def test_a_number_that_moves_no_follower_leaves_the_dead_points_where_they_are(path, followed):
    scene = fl.load_scene("spatial-four-bar")
    loop = parametric_loop(scene, [path])
    moved = loop.at(1.01 * loop.nominal)
    assert moved.clear is (True if followed else None)
    assert moved.complete
