"""One pair of axes with its marks, and how it is drawn: words and legend in HTML, axes and marks as SVG; the browser wraps them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array
from flexlin.plots.scales import Linear

SMALL_FONT = 9.0
"""Size of the font of words among the marks."""
SHAPES = {
    "circle": "M-{r},0a{r},{r} 0 1 0 {d},0a{r},{r} 0 1 0 -{d},0z",
    "square": "M-{r},-{r}h{d}v{d}h-{d}z",
    "diamond": "M0,-{e}L{e},0L0,{e}L-{e},0z",
    "triangle": "M0,-{e}L{e},{r}L-{e},{r}z",
    "cross": "M-{r},0H{r}M0,-{r}V{r}",
}


@dataclass(frozen=True)
class Mark:
    """A line, an area, dots or words at data coordinates; `label` puts it into the legend."""

    kind: str
    x: Array
    y: Array
    style: str
    label: str = ""
    shape: str = ""
    texts: tuple[str, ...] = ()
    anchor: str = "middle"


@dataclass
class Panel:
    """One pair of axes: scales, labels, and marks in the order in which they are drawn.

    `equal` keeps one unit the same length on both axes; `bare` leaves axes and grid out. The width is that of the whole, the height
    that of the axes, where a page is 760 wide. Colours are names of the page's CSS variables.
    """

    title: str = ""
    x: Linear = field(default_factory=Linear)
    y: Linear = field(default_factory=Linear)
    x_label: str = ""
    y_label: str = ""
    equal: bool = False
    bare: bool = False
    width: float = 242.0
    height: float = 80.0
    footer: str = ""
    footer_colour: str = "faint"
    marks: list[Mark] = field(default_factory=list)

    def line(
        self,
        x: ArrayLike,
        y: ArrayLike,
        colour: str,
        width: float = 1.6,
        dash: str = "",
        label: str = "",
        opacity: float = 1.0,
    ) -> "Panel":
        """Join points (N,) by a line."""
        dashes = f";stroke-dasharray:{dash}" if dash else ""
        faded = f";stroke-opacity:{opacity:.2g}" if opacity < 1 else ""
        style = f"fill:none;stroke:var(--{colour});stroke-width:{width}{dashes}{faded}"
        return self._add(Mark("line", *_points(x, y), style, label))

    def area(self, x: ArrayLike, y: ArrayLike, colour: str) -> "Panel":
        """Fill the polygon through points (N,)."""
        return self._add(Mark("area", *_points(x, y), f"fill:var(--{colour});stroke:none"))

    def dots(
        self, x: ArrayLike, y: ArrayLike, colour: str, shape: str = "circle", size: float = 4.0, label: str = "", texts: Sequence[str] = ()
    ) -> "Panel":  # fmt: skip
        """Set a mark at each point (N,); `texts` (N) appear when one points at them."""
        outline = colour if shape == "cross" else "ink"
        style = f"fill:var(--{colour});fill-opacity:.85;stroke:var(--{outline});stroke-width:.8"
        r = {"r": f"{size:g}", "d": f"{2 * size:g}", "e": f"{1.25 * size:g}"}
        return self._add(Mark("dots", *_points(x, y), style, label, SHAPES[shape].format(**r), tuple(texts)))

    def cells(self, x: ArrayLike, y: ArrayLike, colour: str, opacity: float) -> "Panel":
        """Fill rectangles from low to high ends, (2, N) on each axis."""
        style = f"fill:var(--{colour});fill-opacity:{opacity:.2g};stroke:none"
        return self._add(Mark("cells", *_points(np.ravel(x), np.ravel(y)), style))

    def hatch(self, x: ArrayLike, y: ArrayLike, colour: str) -> "Panel":
        """Hatch rectangles from low to high ends, (2, N) on each axis."""
        style = f"stroke:var(--{colour});stroke-opacity:.45;stroke-width:1"
        return self._add(Mark("hatch", *_points(np.ravel(x), np.ravel(y)), style))

    def probe(self, data: str) -> "Panel":
        """Lay a sheet without colour over the axes, which bears data (JSON) for a script that reads the pointer's place."""
        return self._add(Mark("probe", np.zeros(0), np.zeros(0), "fill:none;pointer-events:all", texts=(data,)))

    def words(
        self, x: float, y: float, text: str, colour: str = "faint", anchor: str = "middle", halo: bool = False
    ) -> "Panel":
        """Write a few words at a point; a halo in the paper's colour keeps them legible on marks."""
        around = ";paint-order:stroke;stroke:var(--paper);stroke-width:2.6px;stroke-linejoin:round" if halo else ""
        style = f"fill:var(--{colour});font-size:{SMALL_FONT}px;text-anchor:{anchor}{around}"
        return self._add(Mark("words", *_points([x], [y]), style, texts=(text,), anchor=anchor))

    def zero(self) -> "Panel":
        """A thin line at y = 0, across; zero then lies inside the axis."""
        return self._add(Mark("zero", np.zeros(0), np.zeros(1), "stroke:var(--faint);stroke-width:.7"))

    def _add(self, mark: Mark) -> "Panel":
        self.marks.append(mark)
        return self

    @property
    def legend(self) -> list[Mark]:
        """The marks that bear a label."""
        return [mark for mark in self.marks if mark.label]

    def fitted(self) -> tuple[Linear, Linear]:
        """Both scales with their open ends set by the marks."""
        x = np.concatenate([np.zeros(0), *(mark.x for mark in self.marks)])
        y = np.concatenate([np.zeros(0), *(mark.y for mark in self.marks)])
        return self.x.fitted(x), self.y.fitted(y)


def measure_text(text: str, size: float = 11.0) -> float:
    """About how wide a text will be, a little on the safe side."""
    return 0.64 * size * len(text)


def _points(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    return np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))  # type: ignore[return-value]


LINE_HEIGHT, LEFT_MARGIN = 16.0, 46.0
"""A line of words below the axes, and the least margin for labels on their left."""


@dataclass(frozen=True)
class Axes:
    """Where the axes of a panel lie in its drawing, with both scales and the ticks up the side."""

    left: float
    top: float
    width: float
    height: float
    x_scale: Linear
    y_scale: Linear
    y_ticks: Sequence[tuple[float, str]] = ()

    def x(self, values: ArrayLike) -> Array:
        return self.left + self.width * self.x_scale.place(values)

    def y(self, values: ArrayLike) -> Array:
        return self.top + self.height * (1 - self.y_scale.place(values))

    @property
    def bottom(self) -> float:
        return self.top + self.height

    @property
    def right(self) -> float:
        return self.left + self.width

    @property
    def across(self) -> list[tuple[float, str]]:
        """Places and labels of the ticks across."""
        return [(float(self.x(value)), text) for value, text in self.x_scale.ticks(max(2, int(self.width / 62)))]

    @property
    def up(self) -> list[tuple[float, str]]:
        """Places and labels of the ticks up the side."""
        return [(float(self.y(value)), text) for value, text in self.y_ticks]


@cache
def find_template(name: str) -> Any:
    """A template of this room; what draws nothing needs no library for it."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("flexlin.plots")
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.filters["px"] = "{:.1f}".format
    return made.get_template(name)


def draw(panels: Sequence[Panel], legend: Sequence[Mark] = ()) -> str:
    """Panels beside each other as one element of a page, below their common legend."""
    laid = [(panel, lay_axes(panel)) for panel in panels]
    drawn = [(panel, axes, leave_apart(panel.marks, axes)) for panel, axes in laid]
    alike = len({panel.width for panel in panels}) == 1
    functions = {one.__name__: one for one in (draw_rectangles, draw_trace, place_words, zip_longest)}
    page = find_template("panels.html.j2")
    return str(page.render(functions, panels=drawn, legend=legend, alike=alike, line_height=LINE_HEIGHT))


def lay_axes(panel: Panel) -> Axes:
    """The axes, fitted to the marks and to the labels beside them."""
    x, y = panel.fitted()
    if panel.bare:
        x, y = equalize_units(x, y, panel.width, panel.height) if panel.equal else (x, y)
        return Axes(0.0, 4.0, panel.width, panel.height, x, y)
    room = panel.width - 20.0
    if panel.equal:
        x, y = equalize_units(x, y, room - LEFT_MARGIN, panel.height)
    y_ticks = y.ticks(min(7, max(3, int(panel.height / 19))))
    labels = max((measure_text(label) for _, label in y_ticks), default=0.0)
    margin = max(labels + LINE_HEIGHT / 2 + (LINE_HEIGHT if panel.y_label else 0.0), LEFT_MARGIN)
    return Axes(margin, LINE_HEIGHT / 2, room - margin, panel.height, x, y, y_ticks)


def leave_apart(marks: Sequence[Mark], axes: Axes) -> list[Mark]:
    """The marks without words that would be written over others: those that come later stay."""
    kept, taken = list[Mark](), list[tuple[float, float, float]]()
    for mark in reversed(marks):
        if mark.kind == "words":
            (x, up), width = place_words(mark, axes), measure_text(mark.texts[0], SMALL_FONT)
            left = x - share_before(mark) * width
            if any(left < end and start < left + width and abs(up - other) < SMALL_FONT for start, end, other in taken):
                continue
            taken.append((left, left + width, up))
        kept.append(mark)
    return kept[::-1]


def share_before(mark: Mark) -> float:
    """The part of a mark's words that stands left of their point: none, half or all of them."""
    return ("start", "middle", "end").index(mark.anchor) / 2


def place_words(mark: Mark, axes: Axes) -> tuple[float, float]:
    """Where a few words stand: as near to their point as leaves them inside the axes."""
    x, y = float(axes.x(mark.x)[0]), float(axes.y(mark.y)[0])
    before, width = share_before(mark), measure_text(mark.texts[0], SMALL_FONT)
    low, high = axes.left + before * width + 2, axes.right - (1 - before) * width - 2
    return (min(max(x, low), high) if low <= high else x), min(max(y, axes.top + SMALL_FONT), axes.bottom - 3)


def draw_rectangles(mark: Mark, axes: Axes) -> str:
    """Rectangles between low ends, which come first, and high ends, (2 N,), as one path."""
    corners = zip(*np.split(axes.x(mark.x), 2), *np.split(axes.y(mark.y), 2), strict=True)
    return "".join(f"M{a:.2f},{c:.2f}H{b:.2f}V{d:.2f}H{a:.2f}z" for a, b, c, d in corners)


def draw_trace(mark: Mark, axes: Axes) -> str:
    """Points as a path; a point that is not finite breaks the line."""
    across, up = axes.x(mark.x), axes.y(mark.y)
    known = np.isfinite(across) & np.isfinite(up)
    pieces = np.split(np.arange(len(known)), np.flatnonzero(np.diff(known)) + 1)
    return "".join(
        "M" + "L".join(map("%.1f,%.1f".__mod__, zip(across[piece].tolist(), up[piece].tolist(), strict=True)))
        for piece in pieces
        if len(piece) and known[piece[0]]
    )


def equalize_units(x: Linear, y: Linear, width: float, height: float) -> tuple[Linear, Linear]:
    """Widen one of two linear scales until a unit is as long on both axes."""
    (x_low, x_high), (y_low, y_high) = x.ends, y.ends
    unit = max((x_high - x_low) / width, (y_high - y_low) / height)
    more_x, more_y = (unit * width - (x_high - x_low)) / 2, (unit * height - (y_high - y_low)) / 2
    return replace(x, low=x_low - more_x, high=x_high + more_x), replace(y, low=y_low - more_y, high=y_high + more_y)
