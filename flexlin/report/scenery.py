"""What an animation shows of an arm beside its motion: which bodies there are, what stands still, and how large it all is."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.slow_motions import slow_motions
from flexlin.control.tracking import arm_positions
from flexlin.errors import FlexlinError
from flexlin.report.tracing import trace_arm
from flexlin.scene.scene import Scene

STILL = 1e-9
"""A point that moves by less than this share of the reach is fixed to the ground."""
MAGNIFIED = (1, 5, 20)
"""Factors by which bending may be shown."""
MODES, MODE_FRAMES, SWING = 4, 120, 0.15
"""Floquet modes that may be played, their pictures, and their largest deflection: in rad, or against the arm's reach."""


@dataclass(frozen=True)
class Frames:
    """The arm at some times: curves of the links [time][link] (d, k), points (N, d, k) of joints and tip, from the base on; d = 2 or 3."""

    links: list[list[Array]]
    points: Array


def frames_of(lin: Linearization, t: Array, states: Array, magnify: float = 1.0) -> Frames:
    """The arm for deviations (N, n) or (N, 2n) from the rigid motion, its elastic coordinates magnified."""
    factors = np.array([magnify if c.kind == "elastic" else 1.0 for c in lin.coordinates])
    moved = states[:, : lin.n] * factors
    return Frames(trace_arm(lin, t, moved), arm_positions(lin, t, moved)[0])


def fixed_points(points: Array) -> list[int]:
    """Which points never move: there the arm stands on the ground; the last one is the tip."""
    moved = np.ptp(points, axis=0).max(axis=0)
    return [int(i) for i in np.flatnonzero(moved <= STILL * max(float(np.ptp(points)), 1e-300))]


def list_grounds(points: Array) -> list[int]:
    """The fixed points that stand on the ground, each place once: in space the first of several in a row, the next lie on an axis that
    turns."""
    fixed = fixed_points(points)
    grounds = [i for i in fixed if points.shape[1] == 2 or i - 1 not in fixed]
    near = STILL * max(float(np.ptp(points)), 1e-300)
    return [
        i for k, i in enumerate(grounds) if all(np.ptp(points[0][:, [i, j]], axis=1).max() > near for j in grounds[:k])
    ]


def moving_links(links: list[list[Array]]) -> list[int]:
    """Which of the links [time][link] move: one that never does is ground, one without length is a carriage."""
    each = [np.stack(curves) for curves in zip(*links, strict=True)]
    still = STILL * max((float(np.ptp(curves)) for curves in each), default=0.0)
    moved = [np.ptp(curves, axis=0).max() > still and np.ptp(curves, axis=2).max() > still for curves in each]
    return [i for i, found in enumerate(moved) if found]


def bodies(scene: Scene) -> dict[str, bool]:
    """Which rigid bodies the arm carries, of the scene's own effects or of its registered model's numbers."""
    tables = scene.effects.on()
    mass = scene.parameters.get("payload_mass", 0.0)
    inertia = scene.parameters.get("hub_inertia", 0.0)
    return {"payload": "payload" in tables or bool(mass), "hub": "hub" in tables or bool(inertia)}


def scale_length(reach: float) -> float:
    """A round length of about a fifth of the reach."""
    power = 10.0 ** np.floor(np.log10(reach / 5))
    return float(max(step * power for step in (1, 2, 5) if step * power <= reach / 5 * 1.0001))


def list_angles(lin: Linearization, t: Array, states: Array) -> list[dict[str, Any]]:
    """Each joint's angle in degrees, or displacement in m, at each time."""
    _, s = arm_positions(lin, t, states)
    joints = [(i, c) for i, c in enumerate(lin.arm.coordinates) if c.kind == "joint"]
    return [
        {
            "name": c.name,
            "unit": "°" if c.unit == "rad" else c.unit,
            "values": np.round(np.degrees(s[:, i]) if c.unit == "rad" else s[:, i], 4).tolist(),
        }
        for i, c in joints
    ]


def mode_states(lin: Linearization) -> list[tuple[str, Array, Array]]:
    """The slowest Floquet motions over a period: name, times (N,), states (N, 2n + k) with a deflection that can be seen; none where
    no mode is resolved."""
    try:
        slow = slow_motions(lin.periodic_system(), MODES, coordinates=lin.n)
    except FlexlinError:
        return []
    t = lin.period * np.arange(MODE_FRAMES) / MODE_FRAMES
    reach = float(np.ptp(lin.about.of_arm("points", np.zeros(1), np.zeros((1, lin.n)))[0], axis=1).max()) or 1.0
    found = []
    for k, states in enumerate(slow.states):
        x = np.stack([np.interp(t, slow.t, column) for column in states.T], axis=1)
        leading = lin.coordinates[int(np.abs(states[:, : lin.n]).max(axis=0).argmax())]
        size = SWING if leading.unit == "rad" else SWING * reach
        found.append((f"Floquet motion {k + 1}, mostly {leading.name}", t, size * x))
    return found
