"""The steady motion of the scene's loop: each coordinate over the period with the torques it takes, and the tip beside its rigid path."""

from dataclasses import replace

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import ROUNDING, Array
from flexlin.plots.panel import Panel
from flexlin.report.figures.coefficients import list_joints, weigh_entries
from flexlin.report.figures.style import (
    HALF,
    THIRD,
    Picture,
    choose_colour,
    choose_views,
    make_period_panel,
    make_picture,
    resize,
    style_part,
)
from flexlin.report.wording import format_power, format_quantity, in_unit, name_coordinate_unit, scale_values

MOST = 12
"""Panels shown, or one for each joint and each input where these are more."""


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
    folded, heading = [draw_deviation(a, i) for i in rest], f"The {len(rest)} other coordinates"
    return make_picture("response", "Forced periodic response", caption, panels, legend, folded, heading)


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


def draw_tip(a: Analysis) -> Picture | None:
    """The components over the period on the left, the path of the error on the right; in space its three views below."""
    if a.response is None or not np.all(np.isfinite(a.response.tip)):
        return None
    xyz, unit = scale_values(a.response.tip, "m")
    left = make_period_panel(a.plant.period, in_unit("tip minus rigid tip", unit)).zero()
    left.line(a.t, np.linalg.norm(xyz, axis=1), "ink", width=2.0, label="distance")
    for k, values in enumerate(xyz.T):
        colour, _ = style_part(k)
        left.line(a.t, values, colour, label="xyz"[k], dash=("", "6 2", "2 2")[k])
    paths = [
        draw_path(xyz[:, across], xyz[:, up], "xyz"[across], "xyz"[up], unit)
        for across, up in choose_views(xyz.shape[1])
    ]
    panels = resize([left, *paths], 150.0, (2 * THIRD, THIRD) if len(paths) == 1 else (HALF,))
    return make_picture("tip", "Tip error in steady motion", describe_tip_error(a), panels)


def draw_path(x: np.ndarray, y: np.ndarray, across: str, up: str, unit: str) -> Panel:
    """The path of the error in one view."""
    panel = Panel("its path", equal=True, x_label=in_unit(across, unit), y_label=in_unit(up, unit))
    return panel.line(x, y, "ink", label="tip").dots([0], [0], "ink", "cross", 6, label="rigid tip")


def describe_tip_error(a: Analysis) -> str:
    """Its size, and how well that is known."""
    assert a.response is not None
    distance, error = a.response.tip_error, a.response.solution.error
    rms = float(np.sqrt(np.mean(distance[:-1] ** 2)))
    return (
        f"Largest {format_quantity(float(distance.max()), 'm')}, root mean square {format_quantity(rms, 'm')}, by the linear model; "
        f"the states behind it are known to {format_power(error)}."
    )
