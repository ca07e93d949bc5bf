"""The periodic response of the scene's loop, coordinate by coordinate, with the torque it takes."""

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.figures.style import SERIES, Picture, arrange_in_columns, make_period_panel
from flexlin.report.wording import name_coordinate_unit, name_input_units, scale_values
from flexlin.svg import Panel, draw

MOST = 11
TITLE = "Forced periodic response"


def draw_response(a: Analysis) -> Picture | None:
    """A panel for each deviation, and one for the torques."""
    if a.response is None:
        return None
    panels = [draw_deviation(a, i) for i in range(min(a.plant.n, MOST))] + ([draw_torque(a)] if a.plant.inputs else [])
    left_out = f" Only the first {MOST} of {a.plant.n} coordinates are shown." if a.plant.n > MOST else ""
    caption = (
        "Steady deviations from the rigid motion under the scene's loop: q of joints, w of elastic modes. "
        f"Input: feedforward alone dashed, with feedback solid.{left_out}"
    )
    return Picture("response", TITLE, caption, draw(arrange_in_columns(panels, 85), TITLE))


def draw_deviation(a: Analysis, i: int) -> Panel:
    """One coordinate over the period."""
    assert a.response is not None
    values, unit = scale_values(a.response.states[:, i], name_coordinate_unit(a, i))
    return make_period_panel(a.plant.period, f"{a.plant.names[i]} in {unit}").zero().line(a.t, values, "blue")


def draw_torque(a: Analysis) -> Panel:
    """Feedforward, and feedforward with feedback."""
    panel = make_period_panel(a.plant.period, f"input in {name_input_units(a)}")
    for k, values in enumerate(compute_torques(a).T):
        panel.line(a.t, a.coefficients.tau[:, k], "faint", width=1.2, dash="4 3")
        panel.line(a.t, values, SERIES[(k + 1) % len(SERIES)])
    return panel


def compute_torques(a: Analysis) -> Array:
    """Feedforward and feedback together in the periodic response, (N, m)."""
    assert a.response is not None
    return a.closed.law.torque(a.t, a.response.states)
