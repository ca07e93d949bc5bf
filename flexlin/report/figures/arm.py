"""The arm along its motion, bent by the periodic response."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.mechanics.link_shapes import shapes_of
from flexlin.report.analysis import Analysis
from flexlin.report.figures.style import BLUE, FAINT, INK, SERIES, VERMILION, canvas, stacked, time_axis
from flexlin.report.wording import joint_unit
from flexlin.scene.scene import Scene

PHASES = 12
"""Pictures of the arm in one period."""
XI = np.linspace(0.0, 1.0, 33)


def draw_arm(a: Analysis) -> tuple[Figure, str, str]:
    """The arm at equal steps of a period on the left, its joints' motion and feedforward torques on the right."""
    figure, axes = canvas(1, 2, 3.2, width_ratios=[1.1, 1])
    caption = "Joint motion and feedforward torque of the rigid motion over one period."
    if a.arm.points is None:
        axes[0, 0].remove()
    else:
        stroboscope(axes[0, 0], a)
        bent = (
            "bent by the periodic response of the scene's own loop"
            if a.response
            else "rigid: there is no periodic response"
        )
        caption = (
            f"Left: the arm at {PHASES} equal steps of a period, {bent} and drawn to scale, later pictures darker; grey: the rigid motion; "
            f"red: the path of the tip. Right: {caption[0].lower()}{caption[1:]}"
        )
    upper, lower = stacked(axes[0, 1])
    joints(upper, a)
    for i, name in enumerate(a.plant.inputs):
        lower.plot(a.t, a.coefficients.tau[:, i], color=SERIES[i % len(SERIES)], label=name)
    lower.set_title("feedforward torque in N m" if a.plant.inputs else "no torque: every joint is prescribed")
    time_axis(lower, a.plant.period)
    return figure, "The arm along its motion", caption


def joints(axes: Axes, a: Analysis) -> None:
    """Joint angles in degrees, displacements in m."""
    q = a.plant.motion.sample(a.t)[0]
    units = [joint_unit(a.scene, joint) for joint in range(q.shape[1])]
    for joint, unit in enumerate(units):
        values = np.degrees(q[:, joint]) if unit == "rad" else q[:, joint]
        axes.plot(a.t, values, color=SERIES[joint % len(SERIES)], label=f"q{joint + 1}")
    axes.set_title("joint motion in " + " and ".join(sorted({"°" if unit == "rad" else unit for unit in units})))
    if len(units) > 1:
        axes.legend(ncols=len(units), loc="best")
    time_axis(axes, a.plant.period, label=False)


def stroboscope(axes: Axes, a: Analysis) -> None:
    """The arm at equal steps of a period."""
    states = a.response.states if a.response else np.zeros((len(a.t), 2 * a.plant.n))
    bent, rigid = positions(a, states), positions(a, np.zeros_like(states))
    for k, i in enumerate(np.arange(PHASES) * (len(a.t) - 1) // PHASES):
        axes.plot(*path(a.scene, rigid[i], np.zeros(a.arm.n)), color=FAINT, lw=0.7, alpha=0.5)
        axes.plot(*path(a.scene, bent[i], coordinates(a, states)[i]), color=BLUE, lw=1.5, alpha=0.25 + 0.7 * k / PHASES)
    axes.plot(*bent[:, :, -1].T, color=VERMILION, lw=1.2)
    axes.plot(*bent[0, :, :-1], "o", color=INK, ms=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")


def coordinates(a: Analysis, states: Array) -> Array:
    """All coordinates s (N, arm.n) of deviations [y; y'] from the rigid motion."""
    s = a.plant.motion.sample(a.t)[0] @ a.arm.reference.full().T
    s[:, [a.arm.names.index(name) for name in a.plant.names]] += states[:, : a.plant.n]
    return s


def positions(a: Analysis, states: Array) -> Array:
    """World positions (N, 2, k) of joints and tip, in m."""
    p = np.broadcast_to(a.arm.parameters.values, (len(a.t), len(a.arm.parameters.values)))
    return symbolic.evaluate(a.arm.functions["points"], coordinates(a, states), p)[0]


def path(scene: Scene, points: Array, s: Array) -> Array:
    """The axis of the whole arm, (2, N): each link its chord, and across it what its modes add to the chord."""
    curves, first = [], len(scene.links)
    for i, link in enumerate(scene.links):
        base, tip = points[:, i], points[:, i + 1]
        curve = base[:, None] + np.outer(tip - base, XI)
        length = float(np.linalg.norm(tip - base))
        if link.modes and length > 0:
            shapes = shapes_of(scene, i)
            across = (shapes.values(XI) - np.outer(shapes.values(XI[-1:])[:, 0], XI)).T @ s[first : first + link.modes]
            curve += np.outer([base[1] - tip[1], tip[0] - base[0]], across) / length
        first += link.modes
        curves.append(curve)
    return np.concatenate(curves, axis=1) if curves else points
