"""Stability over one or two scene parameters."""

import numpy as np
import xarray

from flexlin.checks import Array
from flexlin.report.figures.style import Picture
from flexlin.svg import Linear, Panel, Row, draw

TITLE = "Stability chart"
SHADES = 14
"""Strengths of a colour: they follow the square root of the rate, so that slow growth is seen beside fast."""
FAINTEST = 0.18


def draw_chart(data: xarray.Dataset) -> Picture:
    """The growth rate over one parameter as a line, over two as a map."""
    growth = data["exponents"].real.max("mode").to_numpy()
    paths = [str(path) for path in data["verdict"].dims]
    verdict = data["verdict"].to_numpy()
    if len(paths) == 1 or paths == ["value"]:
        path = next(str(name) for name in data.coords)
        return Picture("chart", TITLE, write_caption(verdict), draw_line(path, data[path].to_numpy(), growth, verdict))
    axes = [data[path].to_numpy() for path in paths]
    return Picture(
        "chart",
        TITLE,
        f"{write_caption(verdict)} Stronger: faster growth or decay.",
        draw_area(paths, axes, growth, verdict),
    )


def write_caption(verdict: Array) -> str:
    """How many values are what."""
    counts = ", ".join(f"{int((verdict == name).sum())} {name}" for name in ("stable", "unstable", "undecided"))
    return (
        f"The scene's own loop at {verdict.size} values: {counts}. "
        "Green: stable; red: unstable; amber: undecided, the growth rate is zero to within its error."
    )


def draw_line(path: str, x: Array, growth: Array, verdict: Array) -> str:
    """Growth rate against one parameter, in the colour of its verdict."""
    panel = Panel("largest growth rate in 1/s", x_label=path).zero().line(x, growth, "faint", width=0.8)
    for name in ("stable", "unstable", "undecided"):
        chosen = verdict == name
        if chosen.any():
            panel.dots(x[chosen], growth[chosen], name, size=2.2, label=name)
    return draw([Row([panel], 260)], TITLE)


def draw_area(paths: list[str], axes: list[Array], growth: Array, verdict: Array) -> str:
    """A cell for each pair of values, coloured by its verdict, the stronger the faster it grows or decays."""
    x, y = (find_edges(axis) for axis in axes)
    panel = Panel(x=Linear(x[0], x[-1]), y=Linear(y[0], y[-1]), x_label=paths[0], y_label=paths[1])
    for name in ("stable", "unstable", "undecided"):
        chosen = verdict == name
        shade = choose_shades(growth, chosen) if name != "undecided" else np.full(growth.shape, SHADES // 2)
        for k in np.unique(shade[chosen]):
            i, j = np.nonzero(chosen & (shade == k))
            panel.cells((x[i], x[i + 1]), (y[j], y[j + 1]), name, FAINTEST + (1 - FAINTEST) * k / SHADES)
    return draw([Row([panel], 430)], TITLE)


def choose_shades(growth: Array, chosen: Array) -> Array:
    """0 to SHADES by the square root of the rate against the largest of those chosen."""
    largest = np.abs(growth[chosen]).max(initial=0.0) or 1.0
    return np.round(SHADES * np.sqrt(np.minimum(np.abs(growth) / largest, 1.0))).astype(int)


def find_edges(values: Array) -> Array:
    """The edges of the cells around increasing values: half-way between neighbours."""
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[values[0]], middle, [values[-1]]])
