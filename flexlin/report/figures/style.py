"""One look for all figures: an inline SVG whose colours are CSS variables, so that the page's light or dark mode sets them."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from io import StringIO
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexlin.report.analysis import Loop

INK, FAINT, GRID, SHADE = "#1b1f24", "#68707c", "#d7dce2", "#eef1f4"
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#aa4499", "#e69f00", "#56b4e9"
SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
"""Told apart with every kind of colour blindness. Source: Okabe, Ito (2002), Color Universal Design; purple from Tol (2021)."""
VARIABLES = {
    INK: "ink", FAINT: "faint", GRID: "grid", SHADE: "shade", BLUE: "blue", VERMILION: "vermilion", GREEN: "green",
    PURPLE: "purple", ORANGE: "orange", SKY: "sky", "#ffffff": "paper",
}  # fmt: skip
VERDICTS = {"stable": GREEN, "unstable": VERMILION, "undecided": ORANGE, "failed": FAINT}
WIDTH = 7.6
"""Inches of a figure; the page scales it to its column."""
RC: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "flexlin",
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.labelcolor": FAINT,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "text.color": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
}


@dataclass(frozen=True)
class Picture:
    """One figure of the page."""

    name: str
    title: str
    caption: str
    svg: str


def canvas(rows: int = 1, columns: int = 1, height: float = 2.6, **options: Any) -> tuple[Figure, Any]:
    """A figure of the page's width with an array (rows, columns) of axes."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def stacked(axes: Axes, rows: int = 2) -> list[Axes]:
    """Part the place of one pair of axes into rows."""
    figure, place = axes.figure, axes.get_subplotspec()
    axes.remove()
    assert place is not None
    grid = place.subgridspec(rows, 1)
    return [figure.add_subplot(grid[row, 0]) for row in range(rows)]


def inline_picture(name: str, draw: Callable[[], tuple[Figure, str, str] | None]) -> Picture | None:
    """Draw a figure and turn it into inline SVG; `draw` returns the figure, its title and its caption, or nothing to show."""
    with rc_context(RC):
        drawing = draw()
        if drawing is None:
            return None
        figure, title, caption = drawing
        buffer = StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return Picture(name, title, caption, inline(buffer.getvalue(), name, title))


def inline(svg: str, name: str, title: str) -> str:
    """An SVG document made fit to stand in a page beside others: its own ids, colours as variables, the width of its column."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r'(url\(#|xlink:href="#)', rf"\g<1>{name}-", svg)
    for colour, variable in VARIABLES.items():
        svg = svg.replace(colour, f"var(--{variable})")
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{title}" ', 1)


def time_axis(axes: Axes, period: float, label: bool = True) -> None:
    """An axis of time over one period."""
    axes.set_xlim(0.0, period)
    if label:
        axes.set_xlabel("time in s")


def loop_colour(loop: Loop, position: int) -> str:
    """The colour of a loop: grey for the open loop, then the series in order."""
    return FAINT if loop.kind == "open" else SERIES[position % len(SERIES)]


def subscript(digits: str) -> str:
    """Digits as Unicode subscripts."""
    return digits.translate(str.maketrans("0123456789,", "₀₁₂₃₄₅₆₇₈₉,"))
