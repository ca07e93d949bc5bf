"""The arm along its motion, bent by the periodic response."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.control.tracking import arm_positions
from flexlin.report.figures.style import Picture, make_period_panel, style_part
from flexlin.report.tracing import trace_arm
from flexlin.report.wording import in_unit, is_dimensionless, name_joint_unit
from flexlin.svg import Panel, Row, draw

PHASES = 12
"""Pictures of the arm in one period."""
VIEWS = ((0, 1), (0, 2), (1, 2))
"""World axes across and up of the pictures: one is enough for an arm in its plane."""
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
        draw(lay_out(draw_stroboscope(a), draw_beside(a)), TITLE),
    )


def lay_out(views: list[Panel], beside: list[Panel]) -> list[Row]:
    """One view beside the panels of the motion, or three views above them."""
    if len(views) == 1:
        return [Row([*views, *beside], 220, (1.7, *[1.0] * len(beside)))]
    return [Row(views, 220), Row(beside, 110)]


def draw_beside(a: Analysis) -> list[Panel]:
    """Joint motion, a panel for each unit, and feedforward where there is any."""
    units = [name_joint_unit(a, joint) for joint in range(a.arm.joints)]
    panels = [
        draw_joints(a, [i for i, found in enumerate(units) if found == unit], unit) for unit in sorted(set(units))
    ]
    forces = a.plant.input_units
    return [
        *panels,
        *(
            draw_torques(a, [i for i, found in enumerate(forces) if found == unit], unit)
            for unit in sorted(set(forces))
        ),
    ]


def name_group(a: Analysis, chosen: list[int]) -> str:
    """What a panel of joints shows: the joint's own name where it is one of several."""
    return name_joint(a, chosen[0]) if len(chosen) == 1 < a.arm.joints else "joints"


def draw_joints(a: Analysis, chosen: list[int], unit: str) -> Panel:
    """Joint angles in degrees, or displacements in m; the last sample is left out, for there a turning joint begins anew."""
    t, q = a.t[:-1], a.plant.motion.sample(a.t[:-1])[0]
    panel = make_period_panel(a.plant.period, in_unit(name_group(a, chosen), "°" if unit == "rad" else unit))
    for joint in chosen:
        values = np.degrees(q[:, joint]) if unit == "rad" else q[:, joint]
        colour, dash = style_part(joint)
        panel.line(t, values, colour, dash=dash, label=name_joint(a, joint) if len(chosen) > 1 else "")
    return panel


def draw_torques(a: Analysis, chosen: list[int], unit: str) -> Panel:
    """The torque, force or voltage that the arm would need if its links were rigid."""
    whose = f" {a.plant.inputs[chosen[0]]}" if len(chosen) == 1 < a.arm.joints else ""
    panel = make_period_panel(a.plant.period, in_unit(f"feedforward{whose}", unit))
    for i in chosen:
        colour, dash = style_part(a.plant.driven[i])
        label = a.plant.inputs[i] if len(chosen) > 1 else ""
        panel.line(a.t, a.coefficients.tau[:, i], colour, dash=dash, label=label)
    return panel


def name_joint(a: Analysis, joint: int) -> str:
    """The name of a joint that follows the motion: q1, left q1."""
    moved = np.abs(np.array(a.arm.reference)[:, joint])
    named = [i for i in np.flatnonzero(moved) if a.arm.coordinates[i].kind == "joint"]
    return a.arm.names[named[0] if named else a.arm.drives[joint]]


def draw_stroboscope(a: Analysis) -> list[Panel]:
    """The arm at equal steps of a period, seen along each axis that it is not flat to."""
    states = a.response.states if a.response else np.zeros((len(a.t), 2 * a.plant.n))
    bent, _ = arm_positions(a.plant, a.t, states)
    picked = np.arange(PHASES) * (len(a.t) - 1) // PHASES
    still, moving = (
        [np.concatenate(links, axis=1) for links in trace_arm(a.plant, a.t[picked], x[picked])]
        for x in (np.zeros_like(states), states)
    )
    panels, metres = [], "" if is_dimensionless() else " in m"
    for across, up in VIEWS if bent.shape[1] == 3 else VIEWS[:1]:
        title = "the arm" if bent.shape[1] == 2 else f"the arm along {'xyz'[3 - across - up]}"
        panel = Panel(title, x_label=f"{'xyz'[across]}{metres}", y_label=f"{'xyz'[up]}{metres}", equal=True)
        for curve in still:
            panel.line(curve[across], curve[up], "faint", width=0.8, opacity=0.5)
        for k, curve in enumerate(moving):
            panel.line(curve[across], curve[up], "blue", width=2.0, opacity=0.25 + 0.75 * (k + 1) / PHASES)
        panel.line(bent[:, across, -1], bent[:, up, -1], "rose", width=1.5)
        panels.append(panel.dots(bent[picked[-1], across, :-1], bent[picked[-1], up, :-1], "ink", size=3.5))
    return panels
