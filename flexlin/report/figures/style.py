"""What all figures share: a picture with its words, colours by the page's variables, and panels over a period."""

from collections.abc import Sequence
from dataclasses import dataclass

from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.plots.panel import Mark, Panel, measure_text
from flexlin.plots.scales import Linear
from flexlin.plots.svg import LINE, WIDTH, Row, draw
from flexlin.plots.view import COLOURS
from flexlin.report.wording import time_label

SERIES = tuple(COLOURS)
PARTS = ("indigo", "rose", "teal", "olive", "wine", "ink")
"""Of joints, inputs and components, which are no loops. Source: Tol (2021), the muted scheme."""
SHAPES = ("circle", "square", "diamond", "triangle")
DASHES = ("", "6 3", "2 2.5", "8 3 2 3")
OPEN = "faint"
"""The colour of the arm without feedback, where it stands beside other loops."""
FOLDED_ROWS = 3
"""Rows of panels in one drawing of a part that is folded: it is printed without a break."""


@dataclass(frozen=True)
class Picture:
    """One figure of the page: its name, title, caption, its SVG element, and further elements that are folded, under a heading.

    `narrow`: the same for the screen of a phone.
    """

    name: str
    title: str
    caption: str
    svg: str
    folded: tuple[str, ...] = ()
    heading: str = ""
    narrow: str = ""


def make_picture(
    name: str,
    title: str,
    caption: str,
    rows: Sequence[Row],
    legend: Sequence[Mark] = (),
    folded: Sequence[Sequence[Row]] = (),
    heading: str = "",
) -> Picture:
    """Draw a figure: rows of panels below its legend, and further drawings that are folded under a heading."""
    svg, narrow = (draw(rows, title, legend, small) if rows else "" for small in (False, True))
    more = tuple(draw(part, title) + draw(part, title, narrow=True) for part in folded)
    return Picture(name, title, caption, svg, more, heading, narrow)


def choose_views(dimension: int) -> tuple[tuple[int, int], ...]:
    """World axes across and up of the pictures of a path: one is enough for an arm in its plane."""
    return ((0, 1), (0, 2), (1, 2)) if dimension == 3 else ((0, 1),)


def make_period_panel(period: float, title: str, label: bool = True) -> Panel:
    """A panel of something over one period; without `label` the panel below bears the times."""
    return Panel(title, x=Linear(0.0, period), x_label=time_label() if label else "", ticked=(label, True))


def count_columns(panels: Sequence[Panel]) -> int:
    """Three panels in a row, or what leaves fewer places empty and lets titles fit."""
    columns = 2 if len(panels) in (2, 4) else min((3, 4), key=lambda k: -len(panels) % k)
    longest = max((measure_text(panel.title) for panel in panels), default=0.0)
    fitting = max(1, int((WIDTH + LINE) / (longest + LINE)))
    return max(1, min(columns, len(panels), fitting))


def arrange_in_columns(panels: Sequence[Panel], columns: int | None = None) -> list[Row]:
    """Panels row by row; the last of each column bears the times."""
    columns = columns or count_columns(panels)
    for i, panel in enumerate(panels):
        last = i + columns >= len(panels)
        panel.ticked, panel.x_label = (last, True), time_label() if last else ""
    return [Row(panels[i : i + columns], 80.0, (1.0,) * columns) for i in range(0, len(panels), columns)]


def fold(panels: Sequence[Panel]) -> list[list[Row]]:
    """Panels in several drawings of a few rows each, so that a page may end between them."""
    columns = count_columns(panels)
    parts = [panels[i : i + columns * FOLDED_ROWS] for i in range(0, len(panels), columns * FOLDED_ROWS)]
    return [arrange_in_columns(part, columns) for part in parts]


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
