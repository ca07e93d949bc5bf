"""What all figures share: a picture with its words, colours by the page's variables, and panels over a period."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexlin.analyses.analysis import Analysis
from flexlin.analyses.judging import Loop
from flexlin.checks import Array
from flexlin.plots.panel import Mark, Panel, draw
from flexlin.plots.scales import Linear, Symlog
from flexlin.plots.view import COLOURS
from flexlin.report.wording import in_unit

WIDTH, GAP = 760.0, 16.0
"""Of a page, and of what is free between two panels."""
CURVE_POINTS = 2000
"""Points of a curve at the most, about two a pixel."""
SERIES = tuple(COLOURS)
PARTS = ("indigo", "rose", "teal", "olive", "wine", "ink")
"""Of joints, inputs and components, which are no loops. Source: Tol (2021), the muted scheme."""
SHAPES = ("circle", "square", "diamond", "triangle")
DASHES = ("", "6 3", "2 2.5", "8 3 2 3")
OPEN = "faint"
"""The colour of the arm without feedback, where it stands beside other loops."""


@dataclass(frozen=True)
class Picture:
    """One figure of the page: its name, title, caption, its panels as HTML, and further panels that are folded, under a heading."""

    name: str
    title: str
    caption: str
    svg: str = ""
    folded: str = ""
    heading: str = ""


Folded = tuple[str, Sequence[Panel]]
"""Panels that are folded, and what they are of: "other entries"."""


def make_picture(
    name: str, title: str, caption: str, panels: Sequence[Panel], legend: Sequence[Mark] = (), folded: Folded = ("", ())
) -> Picture:
    """Draw a figure: its panels below their legend, and further ones that are folded under a heading; four as two and two."""
    if len(panels) in (2, 4) and all(panel.width == Panel.width for panel in panels):
        resize(panels, panels[0].height, 2)
    of, others = folded
    shown, more = (draw(part, key) if part else "" for part, key in ((panels, legend), (others, ())))
    return Picture(name, title, caption, shown, more, f"The {len(others)} {of}")


def make_period_panel(period: float, title: str, unit: str = "") -> Panel:
    """A panel of something over one period, or so many seconds."""
    return Panel(in_unit(title, unit), x=Linear(0.0, period), x_label=in_unit("time", "s"))


RATE_FLOOR = 1e-6
"""In 1/s, below which differences of growth rates are not drawn larger."""


def choose_scale(growth: Array, error: Array) -> Linear:
    """Decades where the rates differ much, else equal steps; never finer than the errors of the rates."""
    known = growth[np.isfinite(growth)]
    noise = max(20 * float(error[np.isfinite(error)].max(initial=0.0)), RATE_FLOOR)
    low, high = float(known.min(initial=0.0)), float(known.max(initial=0.0))
    sizes = np.abs(known[np.abs(known) > noise])
    if sizes.size and sizes.max() > 30 * sizes.min():
        near = 10.0 ** np.floor(np.log10(max(sizes.min(), noise, sizes.max() * 1e-6)))
        return Symlog(near=float(near)).fitted(np.array([low, high, -near, near]))
    room = max(0.08 * (high - low), 2 * noise)
    return Linear(low - room, high + room)


def resize(panels: Sequence[Panel], height: float, *beside: float) -> Sequence[Panel]:
    """The panels with axes of one height, each as wide as so many beside each other: the last of these for all that come after."""
    for i, panel in enumerate(panels):
        panel.width, panel.height = (WIDTH + GAP) // beside[min(i, len(beside) - 1)] - GAP, height
    return panels


def choose_colour(a: Analysis, loop: Loop) -> str:
    """The one colour of a loop on the whole page: blue for the scene's own, grey for the open loop beside it, then the series in order."""
    if loop is a.own:
        return SERIES[0]
    others = [other for other in a.loops if other is not a.own and other is not a.open_loop]
    place = next((i for i, other in enumerate(others) if other is loop), None)
    return OPEN if place is None else SERIES[1 + place % (len(SERIES) - 1)]


def style_part(i: int) -> tuple[str, str]:
    """Colour and dash of the i-th joint, input or component."""
    return PARTS[i % len(PARTS)], DASHES[i % len(DASHES)]
