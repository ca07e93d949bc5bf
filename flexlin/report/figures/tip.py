"""How far the tip is from its rigid path in the periodic response."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.report.figures.style import Picture, make_period_panel, style_part
from flexlin.report.wording import format_power, format_quantity, in_unit, scale_values
from flexlin.svg import Panel, Row, draw

TITLE = "Tip error in steady motion"
VIEWS = {2: ((0, 1),), 3: ((0, 1), (0, 2), (1, 2))}
"""World axes across and up of the path's pictures."""


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
        draw_path(xyz[:, across], xyz[:, up], "xyz"[across], "xyz"[up], unit) for across, up in VIEWS[xyz.shape[1]]
    ]
    rows = [Row([left, *paths], 150, (1.8, 1.0))] if len(paths) == 1 else [Row([left], 130), Row(paths, 150)]
    return Picture("tip", TITLE, write_caption(a), draw(rows, TITLE))


def draw_path(x: np.ndarray, y: np.ndarray, across: str, up: str, unit: str) -> Panel:
    """The path of the error in one view."""
    panel = Panel("its path", equal=True, x_label=in_unit(across, unit), y_label=in_unit(up, unit))
    return panel.line(x, y, "ink", label="tip").dots([0], [0], "ink", "cross", 6, label="rigid tip")


def write_caption(a: Analysis) -> str:
    """Its size, and how well that is known."""
    assert a.response is not None
    distance, error = a.response.tip_error, a.response.solution.error
    rms = float(np.sqrt(np.mean(distance[:-1] ** 2)))
    return (
        f"Largest {format_quantity(float(distance.max()), 'm')}, root mean square {format_quantity(rms, 'm')}, by the linear model; "
        f"the states behind it are known to {format_power(error)}."
    )
