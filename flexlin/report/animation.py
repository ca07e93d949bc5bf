"""The arm in motion: one self-contained page that plays a simulation and Floquet modes, with all bodies, to scale."""

import json
from typing import Any

import numpy as np

import flexlin
from flexlin.checks import Array
from flexlin.control.slow_motions import slow_motions
from flexlin.control.tracking import arm_positions
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.linearization.linearization import Linearization
from flexlin.precision import ROOT_EPS
from flexlin.report.figures.exponents import SWING_SHARE
from flexlin.report.figures.over_period import trace_arm
from flexlin.report.page import TEMPLATES
from flexlin.scene.scene import Scene
from flexlin.simulation.result import Simulation

MAGNIFIED = (1, 5, 20)
"""Factors by which bending may be shown."""
MOST_FRAMES = 600
"""Pictures at the most: a longer simulation is shown in wider steps."""

BODIES = {"payload": "payload_mass", "hub": "hub_inertia"}
"""Rigid bodies that an arm may carry: the effect, and the number of a registered model."""

Frames = tuple[list[list[Array]], Array]
"""The arm at some times: curves of the links [time][link] (d, k), points (N, d, k) of joints and tip, from the base on; d = 2 or 3."""


def frames_of(lin: Linearization, t: Array, states: Array, magnify: float = 1.0) -> Frames:
    """The arm for deviations (N, n) or (N, 2n) from the rigid motion, its elastic coordinates magnified."""
    factors = np.array([magnify if c.kind == "elastic" else 1.0 for c in lin.coordinates])
    moved = states[:, : lin.n] * factors
    return trace_arm(lin, t, moved), arm_positions(lin, t, moved)[0]


def list_grounds(points: Array) -> list[int]:
    """The points that never move, where the arm stands on the ground, each place once; the last point is the tip.

    In space it is the first of several in a row: the next lie on an axis that turns.
    """
    near = ROOT_EPS * max(float(np.ptp(points)), 1e-300)
    fixed = np.flatnonzero(np.ptp(points, axis=0).max(axis=0) <= near).tolist()
    kept: list[int] = []
    for i in fixed if points.shape[1] == 2 else [i for i in fixed if i - 1 not in fixed]:
        if all(np.ptp(points[0][:, [i, j]], axis=1).max() > near for j in kept):
            kept.append(i)
    return kept


def scale_length(reach: float) -> float:
    """A round length of about a fifth of the reach."""
    power = 10.0 ** np.floor(np.log10(reach / 5))
    return float(max(step * power for step in (1, 2, 5) if step * power <= reach / 5 * 1.0001))


def list_angles(lin: Linearization, t: Array, states: Array) -> list[dict[str, Any]]:
    """Each joint's angle in degrees, or displacement in m, at each time."""
    _, s = arm_positions(lin, t, states)
    found = []
    for i, c in enumerate(lin.arm.coordinates):
        if c.kind == "joint":
            values, unit = (np.degrees(s[:, i]), "°") if c.unit == "rad" else (s[:, i], c.unit)
            found.append({"name": c.name, "unit": unit, "values": rounded(values, 4)})
    return found


def mode_states(lin: Linearization) -> list[tuple[str, Array, Array]]:
    """The slowest Floquet motions over a period: name, times (N,), states (N, 2n + k) with a deflection that can be seen; none where
    no mode is resolved."""
    try:
        slow = slow_motions(lin.periodic_system(), 4, coordinates=lin.n)
    except FlexlinError:
        return []
    t = lin.period * np.arange(120) / 120
    reach = float(np.ptp(lin.about.near.of_arm("points", np.zeros(1), np.zeros((1, lin.n)))[0], axis=1).max()) or 1.0
    found = []
    for k, states in enumerate(slow.states):
        x = np.stack([np.interp(t, slow.t, column) for column in states.T], axis=1)
        leading = lin.coordinates[int(np.abs(states[:, : lin.n]).max(axis=0).argmax())]
        size = SWING_SHARE if leading.unit == "rad" else SWING_SHARE * reach
        found.append((f"Floquet motion {k + 1}, mostly {leading.title}", t, size * x))
    return found


def animation_page(scene: Scene, lin: Linearization, run: Simulation, command: str = "") -> str:
    """A page that plays a simulation at its own speed: the bent arm, the rigid one, and the tip's paths; or a Floquet motion.

    Assumes equally spaced times, as `simulate` gives them.
    Returns: HTML that asks no other file or host for anything.
    Raises: ArgumentError for a manipulator that does not say where its joints and tip are.
    """
    data = collect_frames(scene, lin, run)
    return TEMPLATES.get_template("animation.html.j2").render(
        title=scene.title,
        status=run.status,
        names=[found["name"] for found in data["plays"]],
        magnified=list(MAGNIFIED),
        shape=min(0.75, max(0.3, data["height"] / data["width"])),
        trail=f"{data['trail'] * data['plays'][0]['step']:.3g}",
        straight=lin.arm.near.axes is None,
        space=len(data["centre"]) == 3,
        data=json.dumps(data, allow_nan=False, separators=(",", ":")),
        command=command,
        version=flexlin.__version__,
    )


def collect_frames(scene: Scene, lin: Linearization, run: Simulation) -> dict[str, Any]:
    """What the page draws: curves in m, rounded to a hundredth of a permille of the arm's reach.

    `plays` holds the simulation first, then Floquet motions.
    """
    if lin.arm.near.points is None:
        expected = "positions of joints and tip"
        raise ArgumentError("there is nothing to draw", got="a model without points", expected=expected)
    every = -(-len(run.t) // MOST_FRAMES)
    t, states = run.t[::every], run.nonlinear[::every]
    plain, _ = frames_of(lin, t, states)
    rigid, points = frames_of(lin, t, np.zeros_like(states))
    corners = np.concatenate([np.concatenate(links, axis=1).T for links in (*plain, *rigid)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    reach = float(max(high - low)) or 1.0
    digits = max(0, 5 - int(np.ceil(np.log10(reach))))
    size = np.maximum(high - low, 0.3 * reach)
    if len(size) == 3:  # turned by hand: nothing leaves a ball about the middle
        size = np.full(2, 2 * np.linalg.norm(corners - (low + high) / 2, axis=1).max())
    plays = [play("simulation", lin, t, states, digits)]
    plays += [play(name, lin, times, x, digits) for name, times, x in mode_states(lin)]
    # of the scene's own effects, or of its registered model's numbers
    bodies = {name: name in scene.effects.on() or bool(scene.parameters.get(key)) for name, key in BODIES.items()}
    away = np.linalg.norm(run.tip - run.tip_rigid, axis=1)[::every]
    return {
        "trail": max(1, int(lin.period / 2 / (t[1] - t[0]))),
        "centre": rounded((low + high) / 2, digits),
        "width": float(size[0]),
        "height": float(size[1]),
        "scale": scale_length(reach),
        "bodies": bodies,
        "ground": [rounded(points[0][:, i], digits) for i in list_grounds(points)],
        "plays": plays,
        "tip": rounded(run.tip[::every], digits),
        "linear": rounded(run.tip_linear[::every], digits),
        "error": rounded(away, 9),
    }


def play(name: str, lin: Linearization, t: Array, states: Array, digits: int) -> dict[str, Any]:
    """One motion to be played: the links at each magnification that leaves the arm in one piece, joints, and joint angles."""
    versions = [frames_of(lin, t, states, factor) for factor in MAGNIFIED]
    whole = [(links, points) for links, points in versions if np.isfinite(points).all()]
    rigid, _ = frames_of(lin, t, np.zeros_like(states))
    return {
        "name": name,
        "t": rounded(t, 6),
        "step": float(t[1] - t[0]),
        "links": [[[rounded(c, digits) for c in links] for links in moving(bent)] for bent, _ in whole],
        "rigid": [[rounded(c, digits) for c in links] for links in moving(rigid)],
        "points": [rounded(points, digits) for _, points in whole],
        "angles": list_angles(lin, t, states),
    }


def moving(frames: list[list[Array]]) -> list[list[Array]]:
    """The links of each picture that move, or all: one that never does is ground, one without length is a carriage."""
    each = [np.stack(curves) for curves in zip(*frames, strict=True)]
    still = ROOT_EPS * max((float(np.ptp(curves)) for curves in each), default=0.0)
    moved = [np.ptp(curves, axis=0).max() > still and np.ptp(curves, axis=2).max() > still for curves in each]
    return [[link for link, moves in zip(links, moved, strict=True) if moves] or links for links in frames]


def rounded(values: Any, digits: int) -> Any:
    """Numbers as nested lists with some digits behind the point."""
    return np.round(np.asarray(values), digits).tolist()
