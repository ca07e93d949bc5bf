"""One pair of axes with its marks."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array
from flexlin.plots.scales import Linear, Scale

FONT = 11.0
SMALL = 9.0
GLYPH = 0.64
"""Width of a character as a share of the font's size, a little on the safe side."""
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

    `equal` keeps one unit the same length on both axes; `bare` leaves axes and grid out, `ticked` = False the numbers across. The width is
    that of the whole, the height that of the axes, where a page is 760 wide. Colours are names of the page's CSS variables.
    """

    title: str = ""
    x: Scale = field(default_factory=Linear)
    y: Scale = field(default_factory=Linear)
    x_label: str = ""
    y_label: str = ""
    equal: bool = False
    bare: bool = False
    ticked: bool = True
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
        self, x: ArrayLike, y: ArrayLike, colour: str, shape: str = "circle", size: float = 4.0, label: str = "",
        texts: Sequence[str] = (),
    ) -> "Panel":  # fmt: skip
        """Set a mark at each point (N,); `texts` (N) appear when one points at them."""
        outline = colour if shape == "cross" else "ink"
        style = f"fill:var(--{colour});fill-opacity:.85;stroke:var(--{outline});stroke-width:.8"
        r = {"r": f"{size:g}", "d": f"{2 * size:g}", "e": f"{1.25 * size:g}"}
        return self._add(Mark("dots", *_points(x, y), style, label, SHAPES[shape].format(**r), tuple(texts)))

    def cells(self, x: tuple[Array, Array], y: tuple[Array, Array], colour: str, opacity: float) -> "Panel":
        """Fill rectangles from low to high ends, ((N,), (N,)) on each axis."""
        style = f"fill:var(--{colour});fill-opacity:{opacity:.2g};stroke:none"
        return self._add(Mark("cells", *_points(np.concatenate(x), np.concatenate(y)), style))

    def hatch(self, x: tuple[Array, Array], y: tuple[Array, Array], colour: str) -> "Panel":
        """Hatch rectangles from low to high ends, ((N,), (N,)) on each axis."""
        return self._add(
            Mark("hatch", *_points(np.concatenate(x), np.concatenate(y)), f"stroke:var(--{colour});stroke-opacity:.45")
        )

    def probe(self, data: str) -> "Panel":
        """Lay a sheet without colour over the axes, which bears data (JSON) for a script that reads the pointer's place."""
        return self._add(Mark("probe", np.zeros(0), np.zeros(0), "fill:none;pointer-events:all", texts=(data,)))

    def words(
        self, x: float, y: float, text: str, colour: str = "faint", anchor: str = "middle", halo: bool = False
    ) -> "Panel":
        """Write a few words at a point; a halo in the paper's colour keeps them legible on marks."""
        around = ";paint-order:stroke;stroke:var(--paper);stroke-width:2.6px;stroke-linejoin:round" if halo else ""
        style = f"fill:var(--{colour});font-size:{SMALL}px;text-anchor:{anchor}{around}"
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

    def fitted(self) -> tuple[Scale, Scale]:
        """Both scales with their open ends set by the marks."""
        x = np.concatenate([mark.x for mark in self.marks] or [np.zeros(1)])
        y = np.concatenate([mark.y for mark in self.marks] or [np.zeros(1)])
        return self.x.fitted(select_finite(x)), self.y.fitted(select_finite(y))


def select_finite(values: Array) -> Array:
    """The finite values, or zero when there is none."""
    kept = values[np.isfinite(values)]
    return kept if kept.size else np.zeros(1)


def measure_text(text: str, size: float = FONT) -> float:
    """About how wide a text will be."""
    return GLYPH * size * len(text)


def write_text(x: float, y: float, text: str, style: str = "", **attributes: str) -> str:
    """A text element."""
    more = "".join(f' {name}="{value}"' for name, value in attributes.items())
    return f'<text x="{x:.1f}" y="{y:.1f}" style="{style}"{more}>{escape(text)}</text>'


def _points(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    return np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))  # type: ignore[return-value]
