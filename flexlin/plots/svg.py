"""Panels in rows on one SVG: margins from the widths of their labels, then marks in pixels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import groupby

import numpy as np

from flexlin.checks import Array
from flexlin.plots.panel import FONT, SMALL, Mark, Panel, measure_text, write_text
from flexlin.plots.scales import Linear, Scale

WIDTH = 760.0
"""Units of the drawing's width; the page scales it to its column."""
NARROW, ABREAST = 380.0, 520.0
"""The same for the screen of a phone, and how wide in units of a page are the panels that stand side by side there."""
LINE, WIDE, ROUGH_MARGIN = 16.0, 20.0, 56.0
"""Of words below each other and gaps beside each other, of titles, keys of a legend, and the margin on the right."""


@dataclass(frozen=True)
class Row:
    """Panels side by side: the height of their axes, and the share of the width that each takes; a share more than panels stays empty."""

    panels: Sequence[Panel]
    height: float
    shares: Sequence[float] = ()


@dataclass(frozen=True)
class Box:
    """Where the axes of a panel lie."""

    left: float
    top: float
    width: float
    height: float

    def x(self, scale: Scale, values: Array) -> Array:
        return self.left + self.width * scale.place(values)

    def y(self, scale: Scale, values: Array) -> Array:
        return self.top + self.height * (1 - scale.place(values))


@dataclass(frozen=True)
class Fitted:
    """A panel with its scales, ticks up the side, and the margin that their labels need."""

    panel: Panel
    x: Scale
    y: Scale
    y_ticks: list[tuple[float, str]]
    margin: float


def draw(rows: Sequence[Row], description: str, legend: Sequence[Mark] = (), narrow: bool = False) -> str:
    """Lay out rows of panels from the top down; returns one svg element, `legend` above all panels."""
    width, rows = (NARROW, stack(rows)) if narrow else (WIDTH, rows)
    parts, top = draw_legend(legend, 4.0, 12.0, width - 8.0), 4.0 + LINE * count_lines(legend, width - 8.0)
    grid = [
        [fit(panel, room, row.height) for panel, room in zip(row.panels, measure_widths(row, width), strict=False)]
        for row in rows
    ]
    for row, fitted in zip(rows, grid, strict=True):
        margins = [
            max(other[k].margin for other in grid if share_columns(other, fitted, k)) for k in range(len(fitted))
        ]
        drawn, top = draw_row(row, fitted, margins, top, measure_widths(row, width))
        parts += drawn
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="{"narrow" if narrow else "broad"}" viewBox="0 0 {width:.0f} {top:.0f}" '
        f'role="img" aria-label="{escape(description)}" '
        f'style="font-size:{FONT}px;fill:var(--ink)">\n{body}\n</svg>'
    )


def stack(rows: Sequence[Row]) -> list[Row]:
    """The same panels in rows for a narrow screen: as many side by side as leaves their words legible, in columns where all are alike."""
    stacked = []
    for (height, *widths), alike in groupby(rows, lambda row: (row.height, *measure_widths(row, WIDTH))):
        if len(set(widths)) == 1:
            stacked += restack([panel for row in alike for panel in row.panels], int(ABREAST // widths[0]) or 1, height)
            continue
        for row in alike:
            groups = list[list[int]]()
            for k, width in enumerate(widths[: len(row.panels)]):
                slight = 4 * width < max(widths)  # the bar of colours beside a map, which gets a quarter of its width
                if groups and (slight or sum(widths[i] for i in groups[-1]) + width <= ABREAST):
                    groups[-1].append(k)
                else:
                    groups.append([k])
            shares = [max(width, max(widths) / 4) for width in widths]
            stacked += [Row([row.panels[k] for k in group], height, [shares[k] for k in group]) for group in groups]
    return stacked


def restack(panels: list[Panel], columns: int, height: float) -> list[Row]:
    """Panels of one width in fewer columns; where only the last of a column bears the labels across, the new last ones do."""
    if not all(panel.ticked[0] for panel in panels):
        label, last = panels[-1].x_label, len(panels) - columns
        panels = [
            replace(panel, ticked=(k >= last, panel.ticked[1]), x_label=label * (k >= last))
            for k, panel in enumerate(panels)
        ]
    return [Row(panels[i : i + columns], height, (1.0,) * columns) for i in range(0, len(panels), columns)]


def measure_widths(row: Row, width: float) -> list[float]:
    """The width of each cell of a row."""
    shares = np.array(row.shares or [1.0] * len(row.panels))
    return [float(one) for one in (width - LINE * (len(shares) - 1)) * shares / shares.sum()]


def share_columns(one: list[Fitted], other: list[Fitted], k: int) -> bool:
    """Whether column k of two rows should line up."""
    return len(one) > k and (one is other or not any(f.panel.equal or f.panel.bare for f in (*one, *other)))


def fit(panel: Panel, width: float, height: float) -> Fitted:
    """Set a panel's open scales by its marks, and find its margin."""
    x, y = panel.fitted()
    if panel.bare:
        return Fitted(panel, *(equalize_units(x, y, width, height) if panel.equal else (x, y)), [], 0.0)
    if panel.equal:
        x, y = equalize_units(x, y, width - ROUGH_MARGIN - WIDE, height)
    y_ticks = y.ticks(min(7, max(3, int(height / 19))))
    labels = max((measure_text(label) for _, label in y_ticks), default=0.0) if panel.ticked[1] else 0.0
    margin = labels + 8.0 + (LINE if panel.y_label else 0.0)
    return Fitted(panel, x, y, y_ticks, max(margin, ROUGH_MARGIN) if panel.equal else margin)


def draw_row(
    row: Row, fitted: list[Fitted], margins: list[float], top: float, widths: list[float]
) -> tuple[list[str], float]:
    """Draw one row; returns its elements and where the next row begins."""
    rooms = [width - margin for width, margin in zip(widths, margins, strict=False)]
    lines = max(count_lines(panel.legend, room) for panel, room in zip(row.panels, rooms, strict=False))
    head = (WIDE if any(panel.title for panel in row.panels) else 6.0) + LINE * lines
    foot = max(LINE * (p.ticked[0] and not p.bare) + LINE * bool(p.x_label or p.footer) for p in row.panels) + 8.0
    parts, left = [], 0.0
    for panel, width, margin in zip(fitted, widths, margins, strict=False):
        right = 0.0 if panel.panel.bare else WIDE
        parts += draw_panel(panel, Box(left + margin, top + head, width - margin - right, row.height), top)
        left += width + LINE
    return parts, top + head + row.height + foot


def draw_panel(fitted: Fitted, box: Box, top: float) -> list[str]:
    """Draw one panel: words above, axes, marks, words below."""
    panel, x, y = fitted.panel, fitted.x, fitted.y
    middle = box.left + box.width / 2
    room = box.left + box.width + WIDE - measure_text(panel.title)
    anchor, at = ("middle", middle) if panel.bare else ("start", min(box.left, room))
    parts = [write_text(at, top + 13, panel.title, f"font-weight:600;text-anchor:{anchor}")]
    room = box.width + (0.0 if panel.bare else WIDE)
    first = box.top - 6 - LINE * (count_lines(panel.legend, room) - 1)
    parts += draw_legend(panel.legend, box.left, first, room)
    if not panel.bare:
        parts += draw_axes(panel, box, x, fitted.y_ticks, y)
    parts += [draw_mark(mark, box, x, y) for mark in leave_apart(panel.marks, box, x, y)]
    below = box.top + box.height + LINE * (panel.ticked[0] and not panel.bare) + 12
    style = f"fill:var(--{'faint' if panel.x_label else panel.footer_colour});text-anchor:middle"
    return [*parts, write_text(middle, below, panel.x_label or panel.footer, style)]


def draw_axes(panel: Panel, box: Box, x: Scale, y_ticks: list[tuple[float, str]], y: Scale) -> list[str]:
    """Grid lines and labels of both axes."""
    bottom, right = box.top + box.height, box.left + box.width
    ticks = x.ticks(max(2, int(box.width / 62)))
    across = box.x(x, np.array([value for value, _ in ticks]))
    up = box.y(y, np.array([value for value, _ in y_ticks]))
    grid = "".join(f"M{at:.1f},{box.top:.1f}V{bottom:.1f}" for at in across)
    grid += "".join(f"M{box.left:.1f},{at:.1f}H{right:.1f}" for at in up)
    parts = [
        f'<path d="{grid}" style="stroke:var(--grid);stroke-width:.7;fill:none"/>',
        f'<path d="M{box.left:.1f},{box.top:.1f}V{bottom:.1f}H{right:.1f}" style="stroke:var(--faint);stroke-width:.8;fill:none"/>',
    ]
    if panel.ticked[0]:
        style = "fill:var(--faint);text-anchor:middle"
        parts += [write_text(at, bottom + 14, label, style) for at, (_, label) in zip(across, ticks, strict=True)]
    if panel.ticked[1]:
        style = "fill:var(--faint);text-anchor:end"
        parts += [write_text(box.left - 5, at + 4, label, style) for at, (_, label) in zip(up, y_ticks, strict=True)]
    if panel.y_label:
        at, middle = (
            box.left - 11 - max((measure_text(label) for _, label in y_ticks), default=0.0),
            box.top + box.height / 2,
        )
        turned = f"rotate(-90 {at:.1f} {middle:.1f})"
        parts.append(write_text(at, middle, panel.y_label, "fill:var(--faint);text-anchor:middle", transform=turned))
    return parts


def draw_mark(mark: Mark, box: Box, x: Scale, y: Scale) -> str:
    """One mark in pixels."""
    if mark.kind == "zero":
        at = float(box.y(y, np.zeros(1))[0])
        return f'<path d="M{box.left:.1f},{at:.1f}h{box.width:.1f}" style="{mark.style}"/>'
    if mark.kind == "probe":
        place = f'x="{box.left:.1f}" y="{box.top:.1f}" width="{box.width:.1f}" height="{box.height:.1f}"'
        return f'<rect class="probe" {place} style="{mark.style}" data-probe="{escape(mark.texts[0], quote=True)}"/>'
    across, up = box.x(x, mark.x), box.y(y, mark.y)
    if mark.kind == "hatch":
        lines = f'<path d="M0,6L6,0" style="{mark.style};stroke-width:1"/>'
        name = f"hatch{box.width:.0f}"
        pattern = (
            f'<defs><pattern id="{name}" width="6" height="6" patternUnits="userSpaceOnUse">{lines}</pattern></defs>'
        )
        shape = draw_rectangles(across.reshape(2, -1), up.reshape(2, -1))
        return f'{pattern}<path d="{shape}" style="fill:url(#{name});stroke:none"/>'
    if mark.kind == "words":
        return write_text(*place_words(mark, box, float(across[0]), float(up[0])), mark.texts[0], mark.style)
    if mark.kind == "cells":
        return f'<path d="{draw_rectangles(across.reshape(2, -1), up.reshape(2, -1))}" style="{mark.style}"/>'
    if mark.kind == "dots":
        texts = mark.texts or ("",) * len(across)
        return "".join(
            f'<path transform="translate({a:.1f} {b:.1f})" d="{mark.shape}" style="{mark.style}"><title>{escape(text)}</title></path>'
            for a, b, text in zip(across, up, texts, strict=True)
        )
    return f'<path d="{draw_trace(across, up)}{"z" if mark.kind == "area" else ""}" style="{mark.style}"/>'


def leave_apart(marks: Sequence[Mark], box: Box, x: Scale, y: Scale) -> list[Mark]:
    """The marks without words that would be written over others: those that come later stay."""
    kept, taken = list[Mark](), list[tuple[float, float, float]]()
    for mark in reversed(marks):
        if mark.kind == "words":
            place = place_words(mark, box, float(box.x(x, mark.x)[0]), float(box.y(y, mark.y)[0]))
            left = place[0] - share_before(mark) * measure_text(mark.texts[0], SMALL)
            right = left + measure_text(mark.texts[0], SMALL)
            if any(left < end and start < right and abs(place[1] - up) < SMALL for start, end, up in taken):
                continue
            taken.append((left, right, place[1]))
        kept.append(mark)
    return kept[::-1]


def share_before(mark: Mark) -> float:
    """The share of words that stands left of their point."""
    return {"start": 0.0, "middle": 0.5, "end": 1.0}[mark.style.partition("text-anchor:")[2].partition(";")[0]]


def place_words(mark: Mark, box: Box, x: float, y: float) -> tuple[float, float]:
    """Where a few words stand: as near to their point as leaves them inside the axes."""
    before = share_before(mark)
    width = measure_text(mark.texts[0], SMALL)
    low, high = box.left + before * width + 2, box.left + box.width - (1 - before) * width - 2
    return (min(max(x, low), high) if low <= high else x), min(max(y, box.top + SMALL), box.top + box.height - 3)


def draw_rectangles(across: Array, up: Array) -> str:
    """Rectangles between low and high ends (2, N) as one path."""
    (left, right), (bottom, top) = across.tolist(), up.tolist()
    corners = zip(left, right, bottom, top, strict=True)
    return "".join(f"M{a:.2f},{c:.2f}H{b:.2f}V{d:.2f}H{a:.2f}z" for a, b, c, d in corners)


def draw_trace(across: Array, up: Array) -> str:
    """Points as a path; a point that is not finite breaks the line."""
    if np.isfinite(across).all() and np.isfinite(up).all():
        return "M" + "L".join(map("%.1f,%.1f".__mod__, zip(across.tolist(), up.tolist(), strict=True)))
    pen, steps = "M", []
    for a, b in zip(across.tolist(), up.tolist(), strict=True):
        if np.isfinite(a) and np.isfinite(b):
            steps.append(f"{pen}{a:.1f},{b:.1f}")
            pen = "L"
        else:
            pen = "M"
    return "".join(steps)


def wrap_legend(marks: Sequence[Mark], room: float) -> list[list[Mark]]:
    """The marks in lines that are no wider than the room, one mark a line at the least."""
    lines, left = [list[Mark]()], 0.0
    for mark in marks:
        width = measure_entry(mark)
        if lines[-1] and left + width > room:
            lines, left = [*lines, []], 0.0
        lines[-1].append(mark)
        left += width + LINE
    return lines if marks else []


def count_lines(marks: Sequence[Mark], room: float) -> int:
    """How many lines a legend takes."""
    return len(wrap_legend(marks, room))


def measure_entry(mark: Mark) -> float:
    """How wide a mark and its label are in a legend."""
    return (LINE if mark.kind == "dots" else WIDE) + measure_text(mark.label)


def draw_legend(marks: Sequence[Mark], start: float, baseline: float, room: float) -> list[str]:
    """Keys and labels, in as many lines as they need."""
    parts = []
    for line in wrap_legend(marks, room):
        left = start
        for mark in line:
            key = f"M{left:.1f},{baseline - 4:.1f}h{WIDE - 5:.1f}"
            place = f'transform="translate({left + 6:.1f} {baseline - 4:.1f})" ' if mark.kind == "dots" else ""
            parts.append(f'<path {place}d="{mark.shape if place else key}" style="{mark.style}"/>')
            text = left + (LINE if place else WIDE)
            parts.append(write_text(text, baseline, mark.label, "fill:var(--faint)"))
            left += measure_entry(mark) + LINE
        baseline += LINE
    return parts


def equalize_units(x: Scale, y: Scale, width: float, height: float) -> tuple[Scale, Scale]:
    """Widen one of two linear scales until a unit is as long on both axes."""
    if not (isinstance(x, Linear) and isinstance(y, Linear)):
        return x, y
    (x_low, x_high), (y_low, y_high) = x.ends, y.ends
    unit = max((x_high - x_low) / width, (y_high - y_low) / height)
    more_x, more_y = (unit * width - (x_high - x_low)) / 2, (unit * height - (y_high - y_low)) / 2
    return replace(x, low=x_low - more_x, high=x_high + more_x), replace(y, low=y_low - more_y, high=y_high + more_y)
