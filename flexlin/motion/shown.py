"""What a scene looks like: its rigid arm at three times of the motion, and the way of the tip."""

import numpy as np

from flexlin import symbolic
from flexlin.checks import SAMPLES
from flexlin.mechanics import build_manipulator
from flexlin.motion import build_motion
from flexlin.plots.view import Series, View
from flexlin.scene import Scene


def view_motion(scene: Scene) -> View:
    """The links from the base to the tip, along the two axes that they reach farthest on; the joints' motion where places are not known.

    Raises: what building the arm and its motion raises.
    """
    arm = build_manipulator(scene)
    motion = build_motion(scene.motion, arm.joints, arm.parameters, arm)
    t = np.linspace(0.0, motion.period, 3 * SAMPLES + 1)
    q = motion.sample(t)[0]
    if arm.points is None:
        curves = tuple(Series(arm.names[k], t, angles) for k, angles in zip(arm.drives, q.T, strict=True))
        return View(scene.title, "", (), "t in s", "q in rad or m", curves)
    places = symbolic.evaluate(
        arm.functions["points"], q @ arm.reference.full().T, np.tile(arm.parameters.values, (len(t), 1))
    )[0]
    across, up = sorted(np.argsort(-np.ptp(places, axis=(0, 2)), kind="stable")[:2])
    second, length = (" s", " in m") if scene.unit_system == "SI" else ("", "")
    arms = [Series(f"{t[k]:.3g}{second}", places[k, across], places[k, up]) for k in range(0, 3 * SAMPLES, SAMPLES)]
    tip = Series("tip", places[:, across, -1], places[:, up, -1], "dashed")
    return View(scene.title, "", (), f"{'xyz'[across]}{length}", f"{'xyz'[up]}{length}", (*arms, tip), equal=True)
