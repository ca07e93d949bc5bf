"""How far the tip is from its rigid path in the periodic response."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.report.figures.style import Picture, make_period_panel
from flexlin.report.wording import format_power, format_quantity, scale_values
from flexlin.svg import Panel, Row, draw

TITLE = "Tip error in steady motion"


def draw_tip(a: Analysis) -> Picture | None:
    """The components over the period on the left, the path of the error on the right."""
    if a.response is None or not np.all(np.isfinite(a.response.tip)):
        return None
    xy, unit = scale_values(a.response.tip, "m")
    left = make_period_panel(a.plant.period, f"tip minus rigid tip in {unit}").zero()
    left.line(a.t, np.hypot(xy[:, 0], xy[:, 1]), "ink", width=2.0, label="distance")
    left.line(a.t, xy[:, 0], "blue", label="x").line(a.t, xy[:, 1], "green", label="y", dash="6 2")
    right = Panel(f"its path in {unit}", equal=True, x_label="x", y_label="y")
    right.line(xy[:, 0], xy[:, 1], "blue").dots([0], [0], "ink", "cross", 6, label="rigid tip")
    return Picture("tip", TITLE, write_caption(a), draw([Row([left, right], 150, (1.8, 1.0))], TITLE))


def write_caption(a: Analysis) -> str:
    """Its size, and how well that is known."""
    assert a.response is not None
    distance, error = a.response.tip_error, a.response.solution.error
    rms = float(np.sqrt(np.mean(distance[:-1] ** 2)))
    return (
        f"Largest {format_quantity(float(distance.max()), 'm')}, root mean square {format_quantity(rms, 'm')}, by the linear model; "
        f"the states behind it are known to {format_power(error)}."
    )
