"""Joint motions that lead the tip along a path: solutions of inverse kinematics followed over a period."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from flexlin.checks import Array
from flexlin.errors import MotionError, ToleranceNotReached
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion.base import MOTION_NODES, Angles, SampledMotion
from flexlin.motion.tip_equations import (
    TipEquations,
    make_circle,
    make_polyline,
    make_tip_equations,
    refuse_unreachable,
)
from flexlin.periodic.circle import count_turns
from flexlin.precision import FAINT, ROOT_EPS
from flexlin.scene.motion import Circle, TipJoint, TipPath
from flexlin.series.tracking import SHORTEST_STEP, find_singular, follow, newton_from, track

POSTURE_TRIES = 24
"""Postures beside the given one from which the path's beginning is sought."""


def tip_angles(equations: TipEquations, period: float, near: CubicHermiteSpline, t: Array) -> Angles:
    """q, q', q'' at any time: the solution from `near`, the cubics between solutions, refined; its rates are exact derivatives."""
    phases = np.mod(t / period, 1.0)
    z = near(phases)
    for _ in range(6):
        step = equations.newton_steps(phases, z)
        z = z - step
        if np.abs(step).max(initial=0.0) < FAINT * (1 + np.abs(z).max(initial=0.0)):
            break
    else:
        worst = int(np.abs(step).max(axis=1).argmax())
        got = f"t = {t[worst]:.6g} s"
        raise ToleranceNotReached("inverse kinematics does not converge between its nodes", got=got)
    rate, second = equations.rates(phases, z)
    n = equations.joints
    return z[:, :n], rate[:, :n] / period, second[:, :n] / period**2


def make_tip_path(table: TipPath, arm: Manipulator, prescribed: tuple[bool, ...]) -> SampledMotion:
    """The motion of an arm's joints that leads its rigid tip along the path of a table.

    Raises: MotionError, with the time, where the path is out of reach, passes a singular place or a joint's limit, or the joints do
    not come back.
    """
    path = make_circle(table.path) if isinstance(table.path, Circle) else make_polyline(table.path)
    joints = table.joints or (TipJoint(),) * arm.joints
    posture = np.array([joint.posture for joint in joints])
    equations = make_tip_equations(arm, path, table.follow, posture)
    problems: list[MotionError] = []
    tried: list[Array] = []
    for start in list_starts(equations, arm, posture, joints):
        begun = begin(equations, start)
        if begun is None or any(is_same_place(begun, other, arm.joints) for other in tried):
            continue
        tried.append(begun)
        try:
            nodes, z = follow_path(equations, begun, path.period)
            refuse_limits(joints, nodes * path.period, z)
        except MotionError as error:
            problems.append(error)
            continue
        near = CubicHermiteSpline(nodes, z, equations.rates(nodes, z)[0])
        angles = partial(tip_angles, equations, path.period, near)
        angles(path.period * (np.arange(4 * MOTION_NODES) + 0.5) / (4 * MOTION_NODES))
        breaks = tuple(path.period * phase for phase in path.breaks)
        return SampledMotion(arm.joints, path.period, prescribed, breaks, sampler=angles)
    if not problems:
        refuse_unreachable(equations, first_start(equations, arm, posture), path.period)
        raise MotionError("inverse kinematics does not find the path's beginning", todo="give posture in motion.joints")
    raise problems[0]


def is_same_place(z: Array, other: Array, joints: int) -> bool:
    """Whether two beginnings differ by whole turns of the joints at most."""
    return bool(np.abs(np.exp(1j * z[:joints]) - np.exp(1j * other[:joints])).max() < ROOT_EPS)


def first_start(equations: TipEquations, arm: Manipulator, q: Array) -> Array:
    """z for joint displacements q: the joints that follow are where the loops close, or where their postures put them."""
    z = np.zeros(equations.size)
    z[: arm.joints] = q
    if arm.near.loops is not None:
        s = arm.reference.full() @ q
        v = arm.near.functions["followers"](s, arm.parameters.values).full()[:, 0]
        z[arm.joints : arm.joints + len(v)] = v
    return z


def list_starts(
    equations: TipEquations, arm: Manipulator, posture: Array, joints: tuple[TipJoint, ...]
) -> Iterator[Array]:
    """Places z from which the path's beginning is sought: the posture, then others within the joints' limits, further and further."""
    yield first_start(equations, arm, posture)
    rng = np.random.default_rng(0)
    for k in range(POSTURE_TRIES):
        low = [p - np.pi if j.low is None else j.low for p, j in zip(posture, joints, strict=True)]
        high = [p + np.pi if j.high is None else j.high for p, j in zip(posture, joints, strict=True)]
        share = (k + 1) / POSTURE_TRIES
        z = first_start(equations, arm, posture + share * (rng.uniform(low, high) - posture))
        if np.isfinite(z).all():
            yield z


def begin(equations: TipEquations, start: Array) -> Array | None:
    """z at the path's beginning, by leading the tip there from where the start has it; None where that ends, or upside down."""
    if not np.isfinite(start).all():
        return None
    away = equations.first(start, 0.0)[0].full()[:, 0]
    z, _ = track(lambda share, z: equations.newton_step(0.0, z, (1 - share) * away), start, 0.0, 1.0, 1e-6)
    z = newton_from(equations.newton_step, 0.0, z) if z is not None else None
    upright = z is not None and float(equations.task(z, 0.0)[2]) > 0
    return z if upright else None


def follow_path(equations: TipEquations, begun: Array, period: float) -> tuple[Array, Array]:
    """Phases (N + 1,) and solutions there, over a whole period.

    Raises: MotionError with the time where the path leaves the reach, or is singular, or the joints do not come back.
    """
    phases = np.arange(MOTION_NODES + 1) / MOTION_NODES
    z, end = follow(equations.newton_step, begun, phases, SHORTEST_STEP)
    refuse_singular(equations, phases[: len(z)], z, period)
    if end is not None:
        refuse_unreachable(equations, z[-1], period, end)
        raise singular(end * period, "leads no further")
    gap = z[-1][: equations.joints] - z[0][: equations.joints]
    turns = 2 * np.pi * count_turns(gap) if not equations.redundant else np.zeros(len(gap))
    worst = int(np.abs(gap - turns).argmax())
    if np.abs(gap - turns).max() > ROOT_EPS:
        raise MotionError(
            "the joints do not come back after a period of the path",
            got=f"joint {worst + 1} ends {gap[worst]:.3g} from where it began",
            expected="a motion that closes",
            todo="keep the path away from singular places, or choose another posture",
        )
    return phases, z


def refuse_singular(equations: TipEquations, phases: Array, z: Array, period: float) -> None:
    """Raise where dF/dz is singular at one of the phases or between them."""
    lengths = np.maximum(np.abs(equations.slopes(phases, z)).max(axis=(0, 2)), 1e-300)[:, None]

    def matrix(phases: Array, z: Array) -> Array:
        return equations.slopes(phases, z) / lengths

    found = find_singular(phases, z, equations.newton_step, matrix, SHORTEST_STEP)
    if found is not None:
        at, least = found
        raise singular(
            at * period, f"has a Jacobian of reciprocal condition number {least:.1e}" if least else "turns over"
        )


def singular(at: float, how: str) -> MotionError:
    """What is raised at a singular place."""
    return MotionError(
        "the path passes a singular place of the arm",
        got=f"inverse kinematics {how} at t = {at:.6g} s",
        todo="lead the path past it, name fewer components in follow, or leave rpy out",
    )


def refuse_limits(joints: tuple[TipJoint, ...], t: Array, z: Array) -> None:
    """Raise where a joint leaves its limits."""
    for i, joint in enumerate(joints):
        for limit, sign, word in ((joint.low, -1, "below"), (joint.high, 1, "above")):
            if limit is None:
                continue
            beyond = sign * (z[:, i] - limit)
            k = int(beyond.argmax())
            if beyond[k] > 0:
                first = int(np.argmax(beyond > 0))
                raise MotionError(
                    f"the path leads joint {i + 1} {word} its limit",
                    got=f"{z[k, i]:.6g} at t = {t[k]:.6g} s, from t = {t[first]:.6g} s on",
                    expected=f"{limit:g}",
                    todo="give another posture, or move the path",
                )
