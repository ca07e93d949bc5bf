"""The arm in motion: one self-contained page that plays a simulation."""

import json
from typing import Any

import numpy as np

import flexlin
from flexlin.about.linear import Linearization
from flexlin.checks import Array
from flexlin.control.tracking import arm_positions
from flexlin.errors import ArgumentError
from flexlin.report.figures.arm import trace_links
from flexlin.report.page import load_template
from flexlin.scene.scene import Scene
from flexlin.simulation import Simulation

FRAMES = 900
"""Pictures at the most: a longer simulation is shown in wider steps."""
TRAIL = 0.5
"""Share of a period for which the tip's path stays on the page."""
SIGHT = np.array([[-1.0, 1.0, 0.0], [-1.0, -1.0, 2.0]]) / np.sqrt([[2.0], [6.0]])
"""An arm in space is seen from (1, 1, 1), with z upwards."""
THIN = 4
"""Every so many points of a link's axis are drawn."""


def animation_page(scene: Scene, lin: Linearization, run: Simulation, command: str = "") -> str:
    """A page that plays a simulation at its own speed: the bent arm, the rigid one, and the tip's paths.

    Assumes equally spaced times, as `simulate` gives them.
    Returns: HTML that asks no other file or host for anything.
    Raises: ArgumentError for a manipulator that does not say where its joints and tip are.
    """
    data = collect_frames(scene, lin, run)
    trail = data["trail"] * data["step"]
    return load_template("animation").render(
        title=scene.title,
        status=run.status,
        frames=len(data["t"]),
        shape=min(0.75, max(0.3, data["height"] / data["width"])),
        trail=f"{trail:.3g}",
        data=json.dumps(data, allow_nan=False, separators=(",", ":")),
        command=command,
        version=flexlin.__version__,
    )


def collect_frames(scene: Scene, lin: Linearization, run: Simulation) -> dict[str, Any]:
    """What the page draws: curves in m, rounded to a hundredth of a permille of the arm's reach."""
    if lin.arm.points is None:
        raise ArgumentError(
            "there is nothing to draw", got="a model without points", expected="positions of joints and tip"
        )
    every = -(-len(run.t) // FRAMES)
    t, states = run.t[::every], run.nonlinear[::every]
    bent, s = arm_positions(lin, t, states)
    rigid, _ = arm_positions(lin, t, np.zeros_like(states))
    arm = [thin_out(trace_links(scene, points, row)) for points, row in zip(bent, s, strict=True)]
    tip, linear, error = run.tip[::every], run.tip_linear[::every], np.linalg.norm(run.tip - run.tip_rigid, axis=1)
    if bent.shape[1] == 3:
        bent, rigid, arm, tip, linear = (
            SIGHT @ bent,
            SIGHT @ rigid,
            [SIGHT @ c for c in arm],
            tip @ SIGHT.T,
            linear @ SIGHT.T,
        )
    low, high = bent.min(axis=(0, 2)), bent.max(axis=(0, 2))
    low, high = np.minimum(low, rigid.min(axis=(0, 2))), np.maximum(high, rigid.max(axis=(0, 2)))
    reach = float(max(high - low)) or 1.0
    digits = max(0, 5 - int(np.ceil(np.log10(reach))))
    size = np.maximum(high - low, 0.3 * reach)

    def rounded(values: Any) -> Any:
        return np.round(np.asarray(values), digits).tolist()

    return {
        "t": np.round(t, 6).tolist(),
        "step": float(t[1] - t[0]),
        "trail": max(1, int(TRAIL * lin.period / (t[1] - t[0]))),
        "centre": rounded((low + high) / 2),
        "width": float(size[0]),
        "height": float(size[1]),
        "arm": [rounded(curve) for curve in arm],
        "joints": [rounded(points[:, :-1]) for points in bent],
        "rigid": [rounded(points) for points in rigid],
        "tip": rounded(tip),
        "linear": rounded(linear),
        "error": np.round(error[::every], 9).tolist(),
    }


def thin_out(curve: Array) -> Array:
    """Every few points of a curve, its end always among them."""
    kept = np.unique(np.append(np.arange(0, curve.shape[1], THIN), curve.shape[1] - 1))
    return curve[:, kept]
