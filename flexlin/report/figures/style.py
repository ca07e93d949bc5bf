"""What all figures share: a picture with its words, colours by the page's variables, and panels over a period."""

from dataclasses import dataclass

from flexlin.answers.judging import Loop
from flexlin.report.wording import time_label
from flexlin.svg import Linear, Panel, Row

SERIES = ("blue", "vermilion", "green", "purple", "orange", "sky")
"""Distinguishable with every kind of colour blindness. Source: Okabe, Ito (2002), Color Universal Design; purple from Tol (2021)."""
SHAPES = ("circle", "square", "diamond", "triangle")
DASHES = ("", "6 3", "2 2.5", "8 3 2 3")


@dataclass(frozen=True)
class Picture:
    """One figure of the page: its name, title, caption, and its SVG element."""

    name: str
    title: str
    caption: str
    svg: str


def make_period_panel(period: float, title: str, label: bool = True) -> Panel:
    """A panel of something over one period; without `label` the panel below bears the times."""
    return Panel(title, x=Linear(0.0, period), x_label=time_label() if label else "", ticked=(label, True))


def arrange_in_columns(panels: list[Panel], height: float) -> list[Row]:
    """Panels row by row, three in a row or what leaves fewer places empty; the last one of each column bears the labels of time."""
    columns = 2 if len(panels) in (2, 4) else min((3, 4), key=lambda k: -len(panels) % k)
    columns = max(1, min(columns, len(panels)))
    for i, panel in enumerate(panels):
        last = i + columns >= len(panels)
        panel.ticked, panel.x_label = (last, True), time_label() if last else ""
    return [Row(panels[i : i + columns], height, (1.0,) * columns) for i in range(0, len(panels), columns)]


def choose_loop_colour(loop: Loop, position: int) -> str:
    """The colour of a loop: grey for the open loop, then the series in order."""
    return "faint" if loop.kind == "open" else SERIES[position % len(SERIES)]
