"""Basic motions, from a scene's motion table."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.arguments import checked
from flexlin.checks import SAMPLES
from flexlin.errors import ArgumentError, MotionError
from flexlin.mechanics import build_manipulator
from flexlin.mechanics.coordinates import Parameters
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion.base import Motion, SampledMotion, SymbolicMotion
from flexlin.motion.smooth import MAKERS, highest_harmonic, read_nominal
from flexlin.motion.table import read_log_motion, read_table_motion
from flexlin.plots.view import Series, View
from flexlin.scene.loading import read_motion
from flexlin.scene.motion import AnyMotion, LogMotion, TableMotion, TipPath
from flexlin.scene.scene import Scene

__all__ = ["Motion", "SampledMotion", "SymbolicMotion", "build_motion"]


@checked
def build_motion(
    table: AnyMotion | Mapping[str, Any],
    joints: int | None = None,
    parameters: Parameters | None = None,
    arm: Manipulator | None = None,
) -> Motion:
    """Make the basic motion that a scene's motion table describes.

    Parameters
    ----------
    table : Harmonic, Rotation, Fourier, PointToPoint, TableMotion, LogMotion or TipPath, or a dict of its keys
        The scene's `motion`.
    joints : int, optional
        Number of joints of the manipulator; by default the arm's, or as many as the table has.
    parameters : Parameters, optional
        Free scene parameters: those below `motion.` become symbols of the motion.
    arm : Manipulator, optional
        The arm, which a path of its tip needs.

    Returns
    -------
    Motion
        q(t), q'(t), q''(t), the period in s and the breaks.

    Raises
    ------
    MotionError
        When the table does not fit the manipulator or describes no usable motion.
    SceneError
        For a dict that is no motion table, naming each key.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> motion = fl.build_motion(fl.load_scene("single-link").motion, joints=1)
    >>> q, rate, acceleration = motion.sample(np.array([0.0, 0.5]))
    >>> motion.period, q.round(6).tolist()
    (2.0, [[0.0], [0.5]])
    """
    if isinstance(table, Mapping):
        slides = {one.unit == "m" for one in arm.coordinates if one.kind == "joint"} if arm else {False}
        table = read_motion(table, None if len(slides) > 1 else True in slides)
    if joints is None:
        joints = len(table.joints) if arm is None else arm.joints
    if not joints:
        raise ArgumentError(
            "joints are not known", got=joints, expected="how many joints the arm has", todo="give joints= or arm="
        )
    tables = table.joints or (None,) * joints
    if len(tables) != joints:
        raise MotionError("the motion has the wrong number of joints", got=len(tables), expected=str(joints))
    prescribed = tuple((joint.drive if joint and joint.drive else table.drive) == "prescribed" for joint in tables)
    if isinstance(table, TipPath):
        if arm is None:
            raise MotionError("a path of the tip needs the arm", got="none", todo="build_motion(..., arm=arm)")
        from flexlin.motion.tip_path import make_tip_path  # takes long to load, and few motions need it

        return make_tip_path(table, arm, prescribed)
    if isinstance(table, TableMotion):
        return read_table_motion(table, joints, prescribed)
    if isinstance(table, LogMotion):
        return read_log_motion(table, joints, prescribed)
    parameters = parameters or Parameters()
    free, phase = parameters.placed_in(table, "motion."), ca.SX.sym("phase")
    angles, duration, breaks = MAKERS[type(free)](free, phase, parameters)
    period = read_nominal(duration, parameters)
    return SymbolicMotion(
        joints,
        period,
        prescribed,
        breaks=tuple(period * edge for edge in breaks),
        periodic=getattr(table, "course", "there-and-back") != "one-way",
        harmonics=highest_harmonic(table),
        phase=phase,
        angles=angles,
        duration=duration,
        parameters=parameters,
    )


def view_motion(scene: Scene) -> View:
    """What a scene looks like: its rigid arm at three times of the motion, and the way of the tip.

    The links from the base to the tip, along the two axes that they reach farthest on; the joints' motion where places are not known.

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
