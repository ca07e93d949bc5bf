"""The largest growth rate over two parameters: a map with contours, colour bar, boundary curves and their resonances."""

import json
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray

from flexlin.answers.stability_boundary import BoundaryCurve
from flexlin.checks import Array
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Linear
from flexlin.report.figures.style import resize
from flexlin.report.wording import in_unit, page_unit

MAP = (640.0, 104.0)
"""Widths of the map and of its bar of colours."""
SHADES = 14
"""Strengths of a colour: they follow the square root of the rate, so that slow growth is seen beside fast."""
FAINTEST = 0.18
LEVELS = 6
"""Contours of the growth rate, about."""
FEWEST = 0.04
"""Labels of contours keep this share of both ranges from the frame, those of resonances half of it from their point."""


def draw_map(
    labels: list[str],
    own: list[float],
    nearest: Array | None,
    data: xarray.Dataset,
    curves: Sequence[BoundaryCurve],
) -> Sequence[Panel]:
    """A cell for each pair of values, contours, the boundary, the scene's own point, and a bar of colours."""
    paths = [str(path) for path in data["verdict"].dims]
    axes = [data[path].to_numpy() for path in paths]
    growth, verdict = data["exponents"].real.max("mode").to_numpy(), data["verdict"].to_numpy()
    x, y = (find_edges(axis) for axis in axes)
    panel = Panel(x=Linear(x[0], x[-1]), y=Linear(y[0], y[-1]), x_label=labels[0], y_label=labels[1])
    fill_cells(panel, x, y, growth, verdict)
    levels = draw_contours(panel, axes, growth, verdict)
    for curve in curves:
        panel.line(curve.points[:, 0], curve.points[:, 1], "ink", width=1.5)
    label_resonances(panel, curves, x, y)
    mark_scene(panel, own, nearest, axes)
    panel.probe(write_probe(labels, axes, growth, verdict))
    return resize([panel, draw_bar(growth, verdict, levels)], 430.0, MAP)


def fill_cells(panel: Panel, x: Array, y: Array, growth: Array, verdict: Array) -> None:
    """Each cell in the colour of its verdict, the stronger the faster; undecided ones hatched, failed ones crossed."""
    for name in ("stable", "unstable", "undecided", "failed"):
        chosen = verdict == name
        shade = choose_shades(growth, chosen) if name in ("stable", "unstable") else np.zeros(growth.shape, dtype=int)
        for k in np.unique(shade[chosen]):
            i, j = np.nonzero(chosen & (shade == k))
            panel.cells((x[i], x[i + 1]), (y[j], y[j + 1]), name, FAINTEST + (1 - FAINTEST) * k / SHADES)
    i, j = np.nonzero(verdict == "undecided")
    if len(i):
        panel.hatch((x[i], x[i + 1]), (y[j], y[j + 1]), "undecided")
    i, j = np.nonzero(verdict == "failed")
    if len(i):
        panel.dots((x[i] + x[i + 1]) / 2, (y[j] + y[j + 1]) / 2, "failed", "cross", 2.5, label="failed")


def choose_shades(growth: Array, chosen: Array) -> Array:
    """0 to SHADES by the square root of the rate against the largest of those chosen."""
    largest = np.abs(growth[chosen]).max(initial=0.0) or 1.0
    return np.round(SHADES * np.sqrt(np.minimum(np.abs(np.nan_to_num(growth)) / largest, 1.0))).astype(int)


def draw_contours(panel: Panel, axes: list[Array], growth: Array, verdict: Array) -> list[float]:
    """Lines of equal growth rate with their figures; returns the levels."""
    decided = growth[(verdict == "stable") | (verdict == "unstable")]
    if not decided.size:
        return []
    scale = Linear(float(min(decided.min(), 0.0)), float(max(decided.max(), 0.0)))
    ticks = [(level, text) for level, text in scale.ticks(LEVELS) if level != 0] if scale.low != scale.high else []
    low, span = (np.array([measure(axis) for axis in axes]) for measure in (np.min, np.ptp))
    drawn, placed = list[float](), list[Array]()
    for level, text in ticks:
        x, y = trace_contour(axes[0], axes[1], growth, level)
        if len(x):
            panel.line(x, y, "ink", width=0.6, opacity=0.55)
            middle = choose_place(np.stack([x, y], axis=1), low, span, placed)
            placed.append(middle)
            panel.words(float(middle[0]), float(middle[1]), text, "ink", halo=True)
            drawn.append(level)
    return drawn


def choose_place(points: Array, low: Array, span: Array, placed: list[Array]) -> Array:
    """The point of a line, off the frame if it can be, that is farthest from all labels so far; its middle where there is none."""
    known = points[np.isfinite(points).all(axis=1)]
    inner = known[(np.minimum(known - low, low + span - known) > FEWEST * span).all(axis=1)]
    known = inner if len(inner) else known
    if not placed:
        return np.asarray(known[len(known) // 2])
    apart = np.min([np.linalg.norm((known - other) / span, axis=1) for other in placed], axis=0)
    return np.asarray(known[apart.argmax()])


def label_resonances(panel: Panel, curves: Sequence[BoundaryCurve], x: Array, y: Array) -> None:
    """The resonance of each tongue, once, from a point inside it on to the right."""
    for text, (across, up) in {shorten(curve.resonance): curve.inside for curve in reversed(curves)}.items():
        panel.words(float(across + FEWEST / 2 * np.ptp(x)), float(up), text, "ink", anchor="start", halo=True)


def shorten(resonance: str) -> str:
    """A resonance in a word or two: principal, order 3."""
    return resonance.split(":")[0].replace(" resonance of order", ", order")


def mark_scene(panel: Panel, own: list[float], nearest: Array | None, axes: list[Array]) -> None:
    """The scene's own numbers, and the way to the nearest boundary."""
    if all(axis.min() <= value <= axis.max() for axis, value in zip(axes, own, strict=True)):
        if nearest is not None:
            panel.line([own[0], nearest[0]], [own[1], nearest[1]], "blue", width=1.2, dash="4 2")
        panel.dots([own[0]], [own[1]], "blue", "diamond", 5.0, label="the scene", texts=["the scene's own numbers"])


def draw_bar(growth: Array, verdict: Array, levels: list[float]) -> Panel:
    """Which colour is which growth rate."""
    panel = Panel(
        in_unit("growth rate", "1/s"),
        x=Linear(0.0, 1.0),
        x_label="\u00a0",
        ticked=False,
    )
    shown = growth[(verdict == "stable") | (verdict == "unstable")]
    low, high = float(min(shown.min(initial=0.0), 0.0)), float(max(shown.max(initial=0.0), 0.0))
    panel.y = Linear(low, high if high > low else low + 1.0)
    for name, end in (("stable", low), ("unstable", high)):
        edges = end * (np.arange(SHADES + 1) / SHADES) ** 2
        for k in range(SHADES if end else 0):
            pair = sorted((edges[k], edges[k + 1]))
            shade = FAINTEST + (1 - FAINTEST) * (k + 0.5) / SHADES
            panel.cells((np.zeros(1), np.ones(1)), (np.array(pair[:1]), np.array(pair[1:])), name, shade)
    for level in levels:
        panel.line([0.0, 1.0], [level, level], "ink", width=0.6, opacity=0.55)
    return panel


def write_probe(labels: list[str], axes: list[Array], growth: Array, verdict: Array) -> str:
    """What the page shows under the pointer, as JSON."""
    rates = [[None if not np.isfinite(value) else float(f"{value:.4g}") for value in row] for row in growth]
    return json.dumps(
        {
            "unit": f" {page_unit('1/s')}".rstrip(),
            "labels": labels,
            "x": axes[0].tolist(),
            "y": axes[1].tolist(),
            "growth": rates,
            "verdict": verdict.tolist(),
        }
    )


def find_edges(values: Array) -> Array:
    """The edges of the cells around increasing values: half-way between neighbours."""
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[values[0]], middle, [values[-1]]])


EDGES = tuple(pairwise(((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))))
"""The edges of a cell, corner to corner."""


def trace_contour(x: Array, y: Array, values: Array, level: float) -> tuple[Array, Array]:
    """The contour as coordinates (N,), its pieces parted by values that are not a number.

    A cell with four crossings joins neighbours on its rim. Source: Lorensen, Cline, Marching cubes (1987), in the plane.
    """
    above = values > level
    pieces: list[tuple[float, float]] = []
    mixed = above[:-1, :-1].astype(int) + above[1:, :-1] + above[:-1, 1:] + above[1:, 1:]
    finite = np.isfinite(values)
    whole = finite[:-1, :-1] & finite[1:, :-1] & finite[:-1, 1:] & finite[1:, 1:]
    for i, j in np.argwhere((mixed > 0) & (mixed < 4) & whole):
        ends = [end for edge in EDGES if (end := cross_edge(x, y, values, level, i, j, edge)) is not None]
        for first, second in zip(ends[::2], ends[1::2], strict=False):
            pieces += [first, second, (np.nan, np.nan)]
    points = np.array(pieces).reshape(-1, 2)
    return points[:, 0], points[:, 1]


def cross_edge(
    x: Array, y: Array, values: Array, level: float, i: int, j: int, edge: tuple[tuple[int, int], tuple[int, int]]
) -> tuple[float, float] | None:
    """Where one edge of a cell meets the level, if it does."""
    (a, b), (c, d) = edge
    first, second = values[i + a, j + b], values[i + c, j + d]
    if (first > level) == (second > level):
        return None
    share = (level - first) / (second - first)
    return (
        float(x[i + a] + share * (x[i + c] - x[i + a])),
        float(y[j + b] + share * (y[j + d] - y[j + b])),
    )
