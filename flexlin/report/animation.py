"""The arm in motion: one self-contained page that plays a simulation and Floquet modes, with all bodies, to scale."""

import json
from typing import Any

import numpy as np

import flexlin
from flexlin.about.linear import Linearization
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.report.page import load_template
from flexlin.report.scenery import (
    MAGNIFIED,
    Frames,
    bodies,
    fixed_points,
    frames_of,
    list_angles,
    list_grounds,
    mode_states,
    moving_links,
    scale_length,
)
from flexlin.scene.scene import Scene
from flexlin.simulation.result import Simulation

FRAMES = 600
"""Pictures at the most: a longer simulation is shown in wider steps."""
TRAIL = 0.5
"""Share of a period for which the tip's path stays on the page."""


def animation_page(scene: Scene, lin: Linearization, run: Simulation, command: str = "") -> str:
    """A page that plays a simulation at its own speed: the bent arm, the rigid one, and the tip's paths; or a Floquet motion.

    Assumes equally spaced times, as `simulate` gives them.
    Returns: HTML that asks no other file or host for anything.
    Raises: ArgumentError for a manipulator that does not say where its joints and tip are.
    """
    data = collect_frames(scene, lin, run)
    return load_template("animation").render(
        title=scene.title,
        status=run.status,
        names=[found["name"] for found in data["plays"]],
        magnified=list(MAGNIFIED),
        shape=min(0.75, max(0.3, data["height"] / data["width"])),
        trail=f"{data['trail'] * data['step']:.3g}",
        straight=lin.arm.axes is None,
        space=len(data["centre"]) == 3,
        data=json.dumps(data, allow_nan=False, separators=(",", ":")),
        command=command,
        version=flexlin.__version__,
    )


def collect_frames(scene: Scene, lin: Linearization, run: Simulation) -> dict[str, Any]:
    """What the page draws: curves in m, rounded to a hundredth of a permille of the arm's reach.

    `plays` holds the simulation first, then Floquet motions; the simulation's own curves stand at the top level too.
    """
    if lin.arm.points is None:
        raise ArgumentError(
            "there is nothing to draw", got="a model without points", expected="positions of joints and tip"
        )
    every = -(-len(run.t) // FRAMES)
    t, states = run.t[::every], run.nonlinear[::every]
    plain, rigid = frames_of(lin, t, states), frames_of(lin, t, np.zeros_like(states))
    corners = np.concatenate([np.concatenate(links, axis=1).T for found in (plain, rigid) for links in found.links])
    low, high = corners.min(axis=0), corners.max(axis=0)
    reach = float(max(high - low)) or 1.0
    digits = max(0, 5 - int(np.ceil(np.log10(reach))))
    size = np.maximum(high - low, 0.3 * reach)
    if len(size) == 3:  # turned by hand: nothing leaves a ball about the middle
        size = np.full(2, 2 * np.linalg.norm(corners - (low + high) / 2, axis=1).max())
    plays = [play("simulation", lin, t, states, digits)]
    plays += [play(name, lin, times, x, digits) for name, times, x in mode_states(lin)]
    tips = [tip[::every] for tip in (run.tip, run.tip_linear)]
    away = np.linalg.norm(run.tip - run.tip_rigid, axis=1)[::every]
    return {
        "t": np.round(t, 6).tolist(),
        "step": float(t[1] - t[0]),
        "trail": max(1, int(TRAIL * lin.period / (t[1] - t[0]))),
        "centre": rounded((low + high) / 2, digits),
        "width": float(size[0]),
        "height": float(size[1]),
        "scale": scale_length(reach),
        "bodies": bodies(scene),
        "fixed": fixed_points(rigid.points),
        "ground": [rounded(rigid.points[0][:, i], digits) for i in list_grounds(rigid.points)],
        "plays": plays,
        "arm": [rounded(np.concatenate(links, axis=1), digits) for links in plain.links],
        "rigid": [rounded(np.concatenate(links, axis=1), digits) for links in moving(rigid)],
        "tip": rounded(tips[0], digits),
        "linear": rounded(tips[1], digits),
        "error": np.round(away, 9).tolist(),
    }


def play(name: str, lin: Linearization, t: Array, states: Array, digits: int) -> dict[str, Any]:
    """One motion to be played: the links at each magnification that leaves the arm in one piece, joints, and joint angles."""
    versions = [frames_of(lin, t, states, factor) for factor in MAGNIFIED]
    whole = [found for found in versions if np.isfinite(found.points).all()]
    rigid = frames_of(lin, t, np.zeros_like(states))
    return {
        "name": name,
        "t": np.round(t, 6).tolist(),
        "step": float(t[1] - t[0]),
        "links": [[[rounded(c, digits) for c in links] for links in moving(found)] for found in whole],
        "rigid": [[rounded(c, digits) for c in links] for links in moving(rigid)],
        "points": [[rounded(at, digits) for at in found.points] for found in whole],
        "angles": list_angles(lin, t, states),
    }


def moving(frames: Frames) -> list[list[Array]]:
    """The links of each picture that move; all, where none seems to."""
    chosen = moving_links(frames.links)
    return [[links[i] for i in chosen] or links for links in frames.links]


def rounded(values: Any, digits: int) -> Any:
    """Numbers as nested lists with some digits behind the point."""
    return np.round(np.asarray(values), digits).tolist()
