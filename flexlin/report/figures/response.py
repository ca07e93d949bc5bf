"""The periodic response of the scene's loop, coordinate by coordinate, with the torques it takes."""

from dataclasses import replace

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.figures.coefficients import list_joints, weigh_entries
from flexlin.report.figures.style import Picture, arrange_in_columns, choose_colour, draw_folded, make_period_panel
from flexlin.report.wording import in_unit, name_coordinate_unit, scale_values
from flexlin.svg import Panel, draw

MOST = 12
"""Panels shown, or one for each joint and each input where these are more."""
HEIGHT = 85.0
ROUNDING = 1e-12
"""A deflection below this share of the largest of its unit is rounding, and drawn as none."""
TITLE = "Forced periodic response"


def draw_response(a: Analysis) -> Picture | None:
    """A panel for each deviation and each input: all joints and inputs, and the coordinates that hold most energy."""
    if a.response is None:
        return None
    joints, inputs = list_joints(a), range(len(a.plant.inputs))
    energy = np.abs(a.response.states[:, : a.plant.n]).max(axis=0) / np.sqrt(np.diagonal(weigh_entries(a)["K"]))
    others = sorted((i for i in range(a.plant.n) if i not in joints), key=lambda i: -energy[i])
    room = max(0, MOST - len(joints) - len(inputs))
    shown, rest = sorted([*joints, *others[:room]]), sorted(others[room:])
    torques = [draw_torque(a, k) for k in inputs]
    legend = torques[0].legend if torques else []
    for panel in torques:
        panel.marks = [replace(mark, label="") for mark in panel.marks]
    panels = [*(draw_deviation(a, i) for i in shown), *torques]
    caption = (
        "Steady deviations from the rigid motion under the scene's loop: q of joints, w of bending, phi of twist, theta of motors; and "
        "what each joint is given." + " Further coordinates are folded below." * bool(rest)
    )
    folded = draw_folded([draw_deviation(a, i) for i in rest], HEIGHT, TITLE)
    svg = draw(arrange_in_columns(panels, HEIGHT), TITLE, legend)
    return Picture("response", TITLE, caption, svg, folded, f"The {len(rest)} other coordinates")


def draw_deviation(a: Analysis, i: int) -> Panel:
    """One coordinate over the period."""
    assert a.response is not None
    same = [k for k in range(a.plant.n) if name_coordinate_unit(a, k) == name_coordinate_unit(a, i)]
    own = a.response.states[:, i]
    if np.abs(own).max() < ROUNDING * np.abs(a.response.states[:, same]).max():
        own = np.zeros_like(own)
    values, unit = scale_values(own, name_coordinate_unit(a, i))
    panel = make_period_panel(a.plant.period, in_unit(a.plant.names[i], unit)).zero()
    return panel.line(a.t, values, choose_colour(a, a.own))


def draw_torque(a: Analysis, k: int) -> Panel:
    """What one input gives: feedforward alone, and with feedback."""
    panel = make_period_panel(a.plant.period, in_unit(f"input {a.plant.inputs[k]}", a.plant.input_units[k]))
    panel.line(a.t, compute_torques(a)[:, k], choose_colour(a, a.own), label=a.own.name)
    return panel.line(a.t, a.coefficients.tau[:, k], "ink", width=1.1, dash="4 3", label="feedforward alone")


def compute_torques(a: Analysis) -> Array:
    """Feedforward and feedback together in the periodic response, (N, m)."""
    assert a.response is not None
    return a.closed.law.torque(a.t, a.response.states)
