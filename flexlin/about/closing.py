"""Do the loops of an arm close all along its rigid motion? Refused with the time where they do not, or are singular."""

from collections.abc import Callable
from functools import partial

import numpy as np

from flexlin.about.deviation import Deviation
from flexlin.checks import Array
from flexlin.errors import MotionError, SingularClosure

PHASES = 256
"""Steps of a period that are looked at."""
GOLDEN, SECTIONS = (np.sqrt(5.0) - 1) / 2, 40
SINGULAR = 1e-7
"""A closure whose V, with columns of length 1, has a reciprocal condition number below this is called singular."""
SUSPECT = 0.05
"""Only below this reciprocal condition number a minimum is looked at more closely."""
SAME = 1e-6
"""Followers that differ by more are those of another assembly."""
SHORTEST, NEWTON = 1e-10, 8
"""The shortest step, as a share of the period, by which the followers are tracked, and Newton's steps at each time."""
OTHER = "move the motion away from there, or give the links other lengths"
NEARER = "give the links a posture from the middle of the motion"


def refuse_open_loops(about: Deviation) -> None:
    """Raise where a loop stays open, its closure V = D_v f becomes singular, or v(u) jumps to another assembly.

    v(u) is held against v tracked from one time to the next. The elastic coordinates are at rest.
    Raises: MotionError, SingularClosure, with the time.
    """
    t = about.motion.period * np.arange(PHASES + 1) / PHASES
    asked = about.of_arm("followers", t, np.zeros((len(t), about.n)))[:, :, 0]
    if not np.isfinite(asked[0]).all():
        raise refused(0.0, "the loops do not close at the start of the motion", NEARER)
    v, lost = [asked[0]], None
    for k in range(1, PHASES + 1):
        found, at = track(about, v[-1], t[k - 1], t[k])
        if found is None:
            refuse_singular(about, t[:k], v)
            raise singular(at, "lets the loops follow no further: they reach a dead point")
        v.append(found)
        same = np.abs(found - asked[k]).max() <= SAME * (1 + np.abs(found).max())
        lost = t[k] if lost is None and not same else lost
    refuse_singular(about, t, v)
    if lost is not None:
        raise refused(lost, "v(u) about the posture does not follow the whole motion", NEARER)


def refuse_singular(about: Deviation, t: Array, v: list[Array]) -> None:
    """Raise where V is singular at one of the times, or between them, while the followers are v."""
    V = [closing(about, at, now) for at, now in zip(t, v, strict=True)]
    signs, size = [np.linalg.slogdet(one)[0] for one in V], np.array([worth(one) for one in V])
    for k in range(1, len(t)):
        if signs[k] != signs[k - 1]:
            a, b = t[k - 1], t[k]
            while b - a > SHORTEST * about.motion.period:
                middle = (a + b) / 2
                passed = np.linalg.slogdet(between(about, t[k - 1], v[k - 1], middle))[0] != signs[k - 1]
                a, b = (a, middle) if passed else (middle, b)
            raise singular(b, "passes through zero")
        if 1 < k < len(t) and size[k - 1] <= min(size[k - 2], size[k], SUSPECT):
            at, least = lowest_worth(about, t[k - 2], v[k - 2], t[k])
            if least < SINGULAR:
                raise singular(at, f"has the reciprocal condition number {least:.1e}")


def closing(about: Deviation, t: float, v: Array) -> Array:
    """V at a time for followers v, its columns scaled to length 1, so that metres and radians count alike."""
    s = about.positions(np.array([t]), np.zeros((1, about.n)))[0][0]
    V = about.arm.functions["closing"](s, v, about.arm.parameters.values).full()
    return np.asarray(V / np.maximum(np.linalg.norm(V, axis=0), 1e-300))


def between(about: Deviation, a: float, v: Array, t: float) -> Array:
    """V at a time t after a, at which the followers are v."""
    found, at = track(about, v, a, t)
    return closing(about, at, v if found is None else found)


def track(about: Deviation, v: Array, a: float, b: float) -> tuple[Array | None, float]:
    """The followers at time b from those at a, by Newton's method over steps that are halved where it fails.

    Returns: the followers, or None where no step leads on, and the time that was reached.
    """
    shortest, step, at = SHORTEST * about.motion.period, b - a, a
    while at < b:
        there = min(at + step, b)
        s = about.positions(np.array([there]), np.zeros((1, about.n)))[0][0]
        found = newton(partial(step_of, about, s), v)
        if found is not None:
            v, at, step = found, there, 2 * step
        elif step < shortest:
            return None, at
        else:
            step /= 2
    return v, at


def step_of(about: Deviation, s: Array, v: Array) -> Array:
    """V^-1 f at s with followers v."""
    return np.asarray(about.arm.functions["newton_step"](s, v, about.arm.parameters.values).full()[:, 0])


def newton(step: Callable[[Array], Array], v: Array) -> Array | None:
    """v with f(v) = 0, by steps that shrink fast from the first one on; None where they do not."""
    last = np.inf
    for _ in range(NEWTON):
        change = step(v)
        size = float(np.abs(change).max())
        if not size < max(last / 16, 1e-12):
            return None
        v, last = v - change, size
        if size < 1e-12 * (1 + float(np.abs(v).max())):
            return v
    return None


def singular(at: float, how: str) -> SingularClosure:
    """What is raised for a singular closure."""
    what, got = "the loops' closure becomes singular along the motion", f"D_v f {how} at t = {at:.6g} s"
    return SingularClosure(what, got=got, todo=OTHER)


def refused(at: float, what: str, todo: str) -> MotionError:
    """What is raised for a loop that is open, or not the one that was."""
    return MotionError(what, got=f"t = {at:.6g} s", expected="loops that stay closed", todo=todo)


def worth(V: Array) -> float:
    """The reciprocal condition number."""
    values = np.linalg.svd(V, compute_uv=False)
    return float(values[-1] / values[0])


def lowest_worth(about: Deviation, a: float, v: Array, b: float) -> tuple[float, float]:
    """Where between two times V has the least reciprocal condition number, and that number, by golden sections; v: followers at a."""
    start = a
    for _ in range(SECTIONS):
        c, d = b - (b - a) * GOLDEN, a + (b - a) * GOLDEN
        left, right = (worth(between(about, start, v, at)) for at in (c, d))
        a, b = (a, d) if left < right else (c, b)
    return (a + b) / 2, worth(between(about, start, v, (a + b) / 2))
