"""How an arm rings and bends with its joints held: at rest in each posture, and along the motion."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import SAMPLES, SUM_ROUNDING, Array
from flexlin.errors import InputError
from flexlin.linearization.linear import linearize
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics import build_manipulator
from flexlin.mechanics.links import COLUMNS
from flexlin.motion import SampledMotion
from flexlin.scene.scene import Scene


@dataclass(frozen=True)
class Bending:
    """The largest deflections of the links' tips, (links,) in m: at rest in each posture, and along the motion; `lengths` of the links."""

    lengths: Array
    at_rest: Array
    moving: Array

    @property
    def largest(self) -> Array:
        """The larger of both against the links' lengths, (links,)."""
        return np.maximum(self.at_rest, self.moving) / np.where(self.lengths > 0, self.lengths, np.inf)


@dataclass(frozen=True)
class AtRest:
    """Natural frequencies in Hz with the joints held as the motion begins, rising; `gives_way`: it buckles or flutters there."""

    frequencies: Array
    gives_way: bool
    bending: Bending | None


def examine(plant: Linearization, lengths: Array) -> AtRest | None:
    """Natural frequencies with the motors held, and the links' quasi-static deflections: K y = h at rest in each posture, and in motion.

    Returns: None for an arm of which nothing moves then.
    """
    arm, motion = plant.arm, plant.motion
    held = replace(motion, prescribed=(True,) * motion.joints)

    def still(t: Array) -> tuple[Array, Array, Array]:
        q = motion.sample(t)[0]
        return q, np.zeros_like(q), np.zeros_like(q)

    resting = SampledMotion(
        motion.joints, motion.period, held.prescribed, motion.breaks, motion.periodic, sampler=still
    )
    try:
        loads = [linearize(arm, one) for one in (resting, held)]
    except InputError:
        return None
    squares = np.linalg.eigvals(np.linalg.solve(loads[0].M(0.0), loads[0].K(0.0)))
    squares = squares[np.argsort(squares.real)]
    rounding = SUM_ROUNDING * np.abs(squares).max()
    if squares[0].real <= rounding or np.abs(squares.imag).max() > rounding:
        return AtRest(np.zeros(0), True, None)
    known = None if arm.axes is None else Bending(lengths, *(bend(lin, lengths) for lin in loads))
    return AtRest(np.sqrt(squares.real) / (2 * np.pi), False, known)


def find_bending(scene: Scene) -> float:
    """By which share of its length a link of a scene bends at most along the motion; 0 where none does, inf where the arm gives way."""
    if not any(any(link.counts.by_direction().values()) for link in scene.links):
        return 0.0
    plant = linearize(build_manipulator(scene), scene.motion)
    found = examine(plant, np.array([link.length for link in scene.links]))
    if found is None or (found.bending is None and not found.gives_way):
        return 0.0
    return np.inf if found.bending is None else float(found.bending.largest.max())


def bend(lin: Linearization, lengths: Array) -> Array:
    """The largest deflection of each link's tip (links,) against its own base, K y = h at each posture; infinite where K is singular,
    0 where it is rounding."""
    t = lin.period * np.arange(SAMPLES) / SAMPLES
    c = lin.sample(t)
    try:
        y = np.linalg.solve(c.K, c.h[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return np.full(len(lengths), np.inf)
    straight = lin.about.near.of_arm("axes", t, np.zeros_like(y))
    found = np.zeros(len(lengths))
    for i in range(len(lengths)):
        own = y * [one.kind == "elastic" and one.link == i and one.mode is not None for one in lin.coordinates]
        end = COLUMNS * (i + 1) - 1
        found[i] = np.linalg.norm(lin.about.near.of_arm("axes", t, own)[:, :, end] - straight[:, :, end], axis=1).max()
    return np.where(found > SUM_ROUNDING * lengths, found, 0.0)
