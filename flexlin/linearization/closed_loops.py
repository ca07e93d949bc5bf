"""Closed loops along the rigid motion: whether they stay closed, never become singular, and keep clear of dead points."""

import numpy as np

from flexlin.checks import SAMPLES, Array
from flexlin.errors import MotionError, SingularClosure
from flexlin.linearization.deviation import Deviation
from flexlin.motion.base import MOTION_NODES
from flexlin.precision import CUBE_ROOT_EPS
from flexlin.series.tracking import SHORTEST_STEP, Step, find_singular, follow

OTHER = "move the motion away from there, or give the links other lengths"
NEARER = "give the links a posture from the middle of the motion"
CLEAR_PARTS = 50
"""A motion that keeps a fiftieth of the period from its dead points has no feature of a half-width below T / 200."""


def refuse_open_loops(about: Deviation) -> None:
    """Raise where a loop stays open, its closure V = D_v f becomes singular, or v(u) jumps to another assembly.

    v(u) is held against v tracked from one time to the next. The elastic coordinates are at rest.
    Raises: MotionError, SingularClosure, with the time.
    """
    t = about.motion.period * np.arange(SAMPLES + 1) / SAMPLES
    s = rigid_positions(about, t)
    asked = about.at_positions("followers", t, s)[:, :, 0]
    if not np.isfinite(asked[0]).all():
        raise refused(0.0, "the loops do not close at the start of the motion", NEARER)
    v, end = follow(newton_along(about), asked[0], t, SHORTEST_STEP * about.motion.period)
    refuse_singular(about, t[: len(v)], v)
    if end is not None:
        raise singular(end, "lets the loops follow no further: they reach a dead point")
    lost = t[~is_same(v, asked).all(axis=1)]
    if len(lost):
        raise refused(lost[0], "v(u) about the posture does not follow the whole motion", NEARER)


def rigid_positions(about: Deviation, t: Array) -> Array:
    """s (N, arm.n) on the rigid motion."""
    return about.positions(t, np.zeros((len(t), about.n)))[0]


def is_same(v: Array, other: Array) -> Array:
    """Whether followers agree, whole turns apart; those of another assembly differ by far more."""
    off = v - other
    return np.asarray(np.abs(off - 2 * np.pi * np.round(off / (2 * np.pi))) <= CUBE_ROOT_EPS * (1 + np.abs(v)))


def refuse_singular(about: Deviation, t: Array, v: Array) -> None:
    """Raise where V, its columns scaled to length 1, is singular at one of the times, or between them, while the followers are v."""

    def matrix(t: Array, v: Array) -> Array:
        V = about.at_positions("closing", t, rigid_positions(about, t), v)
        return np.asarray(V / np.maximum(np.linalg.norm(V, axis=1, keepdims=True), 1e-300))

    found = find_singular(t, v, newton_along(about), matrix, SHORTEST_STEP * about.motion.period)
    if found is not None:
        at, least = found
        raise singular(at, f"has the reciprocal condition number {least:.1e}" if least else "passes through zero")


def newton_along(about: Deviation) -> Step:
    """Newton's step V^-1 f of the followers v at a time."""
    f, p = about.arm.functions["newton_step"], about.arm.parameters.values

    def step(t: float, v: Array) -> Array:
        return np.asarray(f(rigid_positions(about, np.array([t]))[0], v, p).full()[:, 0])

    return step


def singular(at: float, how: str) -> SingularClosure:
    """What is raised for a singular closure."""
    what, got = "the loops' closure becomes singular along the motion", f"D_v f {how} at t = {at:.6g} s"
    return SingularClosure(what, got=got, todo=OTHER)


def refused(at: float, what: str, todo: str) -> MotionError:
    """What is raised for a loop that is open, or not the one that was."""
    return MotionError(what, got=f"t = {at:.6g} s", expected="loops that stay closed", todo=todo)


def keeps_clear(about: Deviation) -> bool:
    """Whether all dead points of the loops lie at least T / CLEAR_PARTS from real times, in the complex plane.

        det V(t) = 0,   V = D_v f:   t - t_0 ~ 1 / mu for the largest eigenvalue mu of V^-1 V'

    The followers v(u(t)), and with them all coefficients, are analytic in t but for zeros of det V. Newton's step towards the nearest zero
    is right within a factor of two where v has a branch point, so one at a distance of T / 200 is seen from every third phase that is
    looked at. The elastic coordinates are at rest.
    """
    T = about.motion.period
    nodes, step = T * np.arange(MOTION_NODES) / MOTION_NODES, CUBE_ROOT_EPS * T
    t = np.concatenate([nodes - step, nodes + step])
    s = rigid_positions(about, t)
    v = about.at_positions("followers", t, s)[:, :, 0]
    if not np.isfinite(v).all():  # a loop is open
        return False
    before, after = np.split(about.at_positions("closing", t, s, v), 2)
    try:
        rates = np.linalg.eigvals(np.linalg.solve(before + after, (after - before) / step))
    except np.linalg.LinAlgError:  # a dead point
        return False
    return bool(np.abs(rates).max(initial=0.0) * T <= CLEAR_PARTS)
