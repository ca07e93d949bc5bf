"""What an animation shows of an arm beside its motion: which bodies there are, what stands still, and how large it all is."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.slow_motions import slow_motions
from flexlin.control.tracking import arm_positions
from flexlin.errors import FlexlinError
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.scene.scene import Scene

SIGHT = np.array([[-1.0, 1.0, 0.0], [-1.0, -1.0, 2.0]]) / np.sqrt([[2.0], [6.0]])
"""An arm in space is seen from (1, 1, 1), with z upwards."""
XI = np.linspace(0.0, 1.0, 33)
"""Places along a link at which its axis is drawn."""
THIN = 4
"""Every so many points of a link's axis are drawn."""
STILL = 1e-9
"""A point that moves by less than this share of the reach is fixed to the ground."""
MAGNIFIED = (1, 5, 20)
"""Factors by which bending may be shown."""
MODES, MODE_FRAMES, SWING = 4, 120, 0.15
"""Floquet modes that may be played, their pictures, and their largest deflection: in rad, or against the arm's reach."""


@dataclass(frozen=True)
class Frames:
    """The arm at some times: curves of the links [time][link] (2, k), points (N, 2, k) of joints and tip, from the base on."""

    links: list[list[Array]]
    points: Array


def frames_of(
    scene: Scene, lin: Linearization, t: Array, states: Array, magnify: float = 1.0, every: int = THIN
) -> Frames:
    """The arm for deviations (N, n) or (N, 2n) from the rigid motion, its elastic coordinates magnified; space is seen from a corner."""
    factors = np.array([magnify if c.kind == "elastic" else 1.0 for c in lin.coordinates])
    points, s = arm_positions(lin, t, states[:, : lin.n] * factors)
    shapes = bends(scene) if points.shape[1] == 2 else []
    links = [
        [thin_out(curve, every) for curve in trace_each(scene, at, row, shapes)]
        for at, row in zip(points, s, strict=True)
    ]
    if points.shape[1] == 3:
        points, links = SIGHT @ points, [[SIGHT @ curve for curve in arm] for arm in links]
    return Frames(links, points)


def thin_out(curve: Array, every: int) -> Array:
    """Every few points of a curve, its end always among them."""
    kept = np.unique(np.append(np.arange(0, curve.shape[1], every), curve.shape[1] - 1))
    return curve[:, kept]


def fixed_points(points: Array) -> list[int]:
    """Which points never move: there the arm stands on the ground; the last one is the tip."""
    moved = np.ptp(points, axis=0).max(axis=0)
    return [int(i) for i in np.flatnonzero(moved <= STILL * max(float(np.ptp(points)), 1e-300))]


def moving_links(points: Array, count: int) -> list[int]:
    """Which of the links move: one between two fixed points is ground, one without length is a carriage."""
    fixed = set(fixed_points(points))
    lengths = np.linalg.norm(np.diff(points, axis=2), axis=1).max(axis=0)
    return [
        i for i in range(count) if not {i, i + 1} <= fixed and lengths[i] > STILL * max(float(np.ptp(points)), 1e-300)
    ]


def bodies(scene: Scene) -> dict[str, bool]:
    """Which rigid bodies the arm carries, of the scene's own effects or of those of its registered model."""
    tables = scene.effects.on() or scene.parameters.get("effects", {})
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
    """The slowest Floquet motions over a period: name, times (N,), states (N, 2n) with a deflection that can be seen; none where
    no mode is resolved."""
    try:
        slow = slow_motions(lin.periodic_system(), MODES)
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


def trace_links(scene: Scene, points: Array, s: Array, shapes: list[Array | None]) -> Array:
    """The axis of the whole arm, (2, N): each link its chord, and across it what its modes add; in space (3, N), the chords."""
    curves = trace_each(scene, points, s, shapes)
    return np.concatenate(curves, axis=1) if scene.links and len(points) == 2 else points


def bends(scene: Scene) -> list[Array | None]:
    """For each link in its plane how far its axis is off its chord at XI by each mode, (33, modes); None for one that is straight."""
    found: list[Array | None] = []
    for i, link in enumerate(scene.links):
        values = make_shapes(scene, i).values if link.counts.y else None
        found.append(None if values is None else (values(XI) - np.outer(values(XI[-1:])[:, 0], XI)).T)
    return found


def trace_each(scene: Scene, points: Array, s: Array, shapes: list[Array | None]) -> list[Array]:
    """The axis of each link, (2, N): its chord, and across it what its modes add; in space, and without links, the chords alone.

    shapes: what `bends` finds, once for many pictures of a scene.
    """
    if len(points) == 3 or not scene.links:
        return [points[:, i : i + 2] for i in range(points.shape[1] - 1)]
    curves, first = [], sum(link.moves for link in scene.links)
    for i, link in enumerate(scene.links):
        base, tip = points[:, i], points[:, i + 1]
        curve = base[:, None] + np.outer(tip - base, XI)
        length = float(np.linalg.norm(tip - base))
        shape = shapes[i]
        if shape is not None and length > 0:
            across = shape @ s[first : first + link.counts.y]
            curve += np.outer([base[1] - tip[1], tip[0] - base[0]], across) / length
        first += sum(link.counts.by_direction().values())
        curves.append(curve)
    return curves
