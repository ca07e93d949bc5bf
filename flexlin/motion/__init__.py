"""Basic motions, from a scene's motion table."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from flexlin.arguments import checked, instance
from flexlin.errors import ArgumentError, MotionError
from flexlin.mechanics.coordinates import Parameters
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion.base import Motion, SampledMotion, SymbolicMotion
from flexlin.motion.smooth import (
    PROFILES as PROFILES,
)
from flexlin.motion.smooth import (
    highest_harmonic,
    make_fourier,
    make_harmonic,
    make_point_to_point,
    make_rotation,
)
from flexlin.motion.table import read_log_motion, read_table_motion
from flexlin.scene.loading import read_motion
from flexlin.scene.motion import (
    AnyMotion,
    Fourier,
    Harmonic,
    LogMotion,
    MotionTable,
    PointToPoint,
    Rotation,
    TableMotion,
    TipPath,
)

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
    instance("table", table, MotionTable, "give scene.motion")
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
    breaks: tuple[float, ...] = ()
    if isinstance(free, PointToPoint):
        angles, duration, breaks = make_point_to_point(free, phase)
    else:
        expressions: dict[type, Any] = {Harmonic: make_harmonic, Rotation: make_rotation, Fourier: make_fourier}
        angles, duration = expressions[type(free)](free, phase, parameters)
    period = float(ca.evalf(ca.substitute(duration, parameters.symbols, ca.DM(parameters.values))))
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
