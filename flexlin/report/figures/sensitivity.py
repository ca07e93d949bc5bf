"""Which numbers of the scene move the growth rate, and which way."""

from typing import TYPE_CHECKING

import numpy as np

from flexlin.report.figures.style import Picture
from flexlin.report.wording import in_unit
from flexlin.svg import Linear, Named, Panel, Row, draw

if TYPE_CHECKING:
    import xarray

TITLE = "Which numbers move the growth rate"
MOST, HEIGHT = 16, 17.0
CAPTION = (
    "What one percent more of each number does to the largest growth rate of the scene's own loop, by exact derivatives. Green: it settles "
    "faster. Red: slower. Numbers that are zero are left out."
)


def draw_sensitivity(data: "xarray.Dataset") -> Picture:
    """Bars to both sides, the strongest on top."""
    slowest = int(np.argmax(data["exponents"].values.real))
    change = data["percent"].values[:, slowest]
    order = np.argsort(np.abs(change))[-MOST:]
    names = tuple(f"{data['parameter'].values[i]} = {data['value'].values[i]:.4g}" for i in order)
    reach = 1.08 * float(np.abs(change).max()) or 1.0
    panel = Panel(
        x=Linear(-reach, reach), y=Named(names), x_label=in_unit("change of the growth rate for 1 % more", "1/s")
    )
    for row, i in enumerate(order):
        corners = [0.0, change[i], change[i], 0.0]
        panel.area(corners, [row - 0.3, row - 0.3, row + 0.3, row + 0.3], "stable" if change[i] < 0 else "unstable")
    panel.line([0, 0], [-0.5, len(order) - 0.5], "ink", width=1.0)
    left_out = f" The {len(change) - MOST} that move it least are not shown." if len(change) > MOST else ""
    return Picture("sensitivity", TITLE, CAPTION + left_out, draw([Row([panel], HEIGHT * len(order))], TITLE))
