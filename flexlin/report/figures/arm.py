"""The arm along its motion, bent by the periodic response."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.control.tracking import arm_positions
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.report.figures.style import SERIES, Picture, make_period_panel
from flexlin.report.wording import name_input_units, name_joint_unit
from flexlin.scene.scene import Scene
from flexlin.svg import Panel, Row, draw

PHASES = 12
"""Pictures of the arm in one period."""
XI = np.linspace(0.0, 1.0, 33)
TITLE = "The arm along its motion"


def draw_arm(a: Analysis) -> Picture:
    """The arm at equal steps of a period, and its joints' motion and feedforward torques beside it."""
    caption = "Joint motion and feedforward of the rigid motion over one period."
    if a.arm.points is None:
        return Picture("arm", TITLE, caption, draw([Row(draw_beside(a), 110)], TITLE))
    bent = (
        "bent by the steady response under the scene's loop"
        if a.response
        else "rigid, because there is no steady response"
    )
    caption = (
        f"The arm at {PHASES} equal steps of a period, {bent}, to scale; later pictures are stronger. Grey: the rigid motion. "
        f"Red: the path of the tip. Beside it: {caption[0].lower()}{caption[1:]}"
    )
    return Picture(
        "arm",
        TITLE,
        caption,
        draw([Row([draw_stroboscope(a), *draw_beside(a)], 220, (1.7, *[1.0] * len(draw_beside(a))))], TITLE),
    )


def draw_beside(a: Analysis) -> list[Panel]:
    """Joint motion, a panel for each unit, and feedforward where there is any."""
    units = [name_joint_unit(a, joint) for joint in range(a.arm.joints)]
    panels = [
        draw_joints(a, [i for i, found in enumerate(units) if found == unit], unit) for unit in sorted(set(units))
    ]
    return [*panels, draw_torques(a)] if a.plant.inputs else panels


def draw_joints(a: Analysis, chosen: list[int], unit: str) -> Panel:
    """Joint angles in degrees, or displacements in m; the last sample is left out, for there a turning joint begins anew."""
    t, q = a.t[:-1], a.plant.motion.sample(a.t[:-1])[0]
    panel = make_period_panel(a.plant.period, f"joints in {'°' if unit == 'rad' else unit}")
    for joint in chosen:
        values = np.degrees(q[:, joint]) if unit == "rad" else q[:, joint]
        panel.line(t, values, SERIES[joint % len(SERIES)], label=f"q{joint + 1}" if q.shape[1] > 1 else "")
    return panel


def draw_torques(a: Analysis) -> Panel:
    """The torque, force or voltage that the arm would need if its links were rigid."""
    several = len(a.plant.inputs) > 1
    panel = make_period_panel(a.plant.period, f"feedforward in {name_input_units(a)}")
    for i, name in enumerate(a.plant.inputs):
        panel.line(a.t, a.coefficients.tau[:, i], SERIES[i % len(SERIES)], label=name if several else "")
    return panel


def draw_stroboscope(a: Analysis) -> Panel:
    """The arm at equal steps of a period."""
    states = a.response.states if a.response else np.zeros((len(a.t), 2 * a.plant.n))
    (bent, s), (rigid, _) = (arm_positions(a.plant, a.t, x) for x in (states, np.zeros_like(states)))
    panel = Panel("the arm", x_label="x in m", y_label="y in m", equal=True)
    picked = np.arange(PHASES) * (len(a.t) - 1) // PHASES
    for i in picked:
        x, y = trace_links(a.scene, rigid[i], np.zeros(a.arm.n))
        panel.line(x, y, "faint", width=0.8, opacity=0.5)
    for k, i in enumerate(picked):
        x, y = trace_links(a.scene, bent[i], s[i])
        panel.line(x, y, "blue", width=2.0, opacity=0.25 + 0.75 * (k + 1) / PHASES)
    panel.line(bent[:, 0, -1], bent[:, 1, -1], "vermilion", width=1.5)
    return panel.dots(bent[picked[-1], 0, :-1], bent[picked[-1], 1, :-1], "ink", size=3.5)


def trace_links(scene: Scene, points: Array, s: Array) -> Array:
    """The axis of the whole arm, (2, N): each link its chord, and across it what its modes add to the chord."""
    curves, first = [], len(scene.links)
    for i, link in enumerate(scene.links):
        base, tip = points[:, i], points[:, i + 1]
        curve = base[:, None] + np.outer(tip - base, XI)
        length = float(np.linalg.norm(tip - base))
        if link.modes and length > 0:
            shapes = make_shapes(scene, i)
            across = (shapes.values(XI) - np.outer(shapes.values(XI[-1:])[:, 0], XI)).T @ s[first : first + link.modes]
            curve += np.outer([base[1] - tip[1], tip[0] - base[0]], across) / length
        first += link.modes
        curves.append(curve)
    return np.concatenate(curves, axis=1) if curves else points
