"""Over one or two scene parameters: growth rates as lines or a map, the Campbell diagram, and what is said under them."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray

from flexlin.analyses.boundary import BoundaryCurve, CriticalValue
from flexlin.checks import Array
from flexlin.errors import counted
from flexlin.periodic.circle import assign
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Linear, Named
from flexlin.report.figures import CURVE_POINTS, GAP, RATE_FLOOR, SERIES, WIDTH, Picture, choose_scale, make_picture
from flexlin.report.wording import in_unit, page_unit, with_unit, with_unit_of, without_units
from flexlin.scene.names import label_number, name_number
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene

LOOPS = {"own": "the scene's own loop", "open": "the arm without feedback"}


@dataclass(frozen=True)
class Chart:
    """A sweep of a scene over one or two numbers, with its critical values or the boundary of stability."""

    scene: Scene
    data: xarray.Dataset
    critical: Sequence[CriticalValue] = ()
    curves: Sequence[BoundaryCurve] = ()

    @property
    def paths(self) -> list[str]:
        """The dotted paths of the numbers."""
        dims = [str(path) for path in self.data["verdict"].dims]
        return [next(str(name) for name in self.data.coords)] if dims == ["value"] else dims

    @property
    def own(self) -> list[float]:
        """The scene's own values of them."""
        return [float(get_value(self.scene, path)) for path in self.paths]

    @property
    def loop(self) -> str:
        """Which loop it is of, in words."""
        loop = str(self.data.attrs.get("loop", "own"))
        return LOOPS.get(loop, f"the loop with {loop}")

    @property
    def nearest(self) -> Array | None:
        """The point of the boundary nearest to the scene's own, both axes counted as shares of their ranges."""
        if not self.curves:
            return None
        span = np.array([np.ptp(self.data[path].to_numpy()) for path in self.paths])
        points = np.concatenate([curve.points for curve in self.curves])
        return np.asarray(points[np.linalg.norm((points - self.own) / span, axis=1).argmin()])


def draw_chart(chart: Chart) -> Picture:
    """The growth rates over one parameter as lines, the largest over two as a map with the boundary and its resonances."""
    labels, shown = [label_number(chart.scene, path) for path in chart.paths], thin(chart.data)
    if len(labels) == 1:
        panels: Sequence[Panel] = [draw_line(labels[0], chart.own[0], shown, chart.critical)]
    else:
        panels = draw_map(chart, labels, shown)
    return make_picture("chart", f"Stability chart of {chart.loop}", describe_chart(chart), panels)


def describe_chart(chart: Chart) -> str:
    """What is said below a chart, a line for each thing; it holds without the picture too."""
    data, nearest = chart.data, chart.nearest
    caption = "\n".join([write_caption(data["verdict"].to_numpy(), chart.loop), *say_failed(chart)])
    bending = [data.attrs["bending"]] if data.attrs.get("bending") else []
    if len(chart.paths) == 1:
        edges = (f"{describe_critical(chart.scene, one)}." for one in chart.critical)
        found = [*dict.fromkeys(edges)]  # those of a tongue that only touches are one
        found += say_none_was_found(data) if not found or data.attrs.get("search") else []
        return "\n".join([caption, *found, *bending])
    said = "" if nearest is None else describe_distance(chart, nearest) + " "
    if nearest is None or data.attrs.get("search"):
        said += say_none_was_found(data)[0]
    shade = f"Stronger: faster growth or decay; lines of equal {in_unit('growth rate', '1/s')}; hatched: undecided."
    return "\n".join([caption, f"{shade} {said}", *bending])


def write_caption(verdict: Array, loop: str) -> str:
    """How many values are what."""
    kinds = ("stable", "unstable", "undecided", "failed", "missing")
    named = (name for name in kinds if name not in kinds[3:] or name in verdict)
    counts = ", ".join(f"{int((verdict == name).sum())} {name}" for name in named)
    return (
        f"{loop[0].upper()}{loop[1:]} at {counted(verdict.size, 'value')}: {counts}. "
        "Green: stable; red: unstable; amber: undecided, the growth rate is zero to within its error."
    )


def say_failed(chart: Chart) -> list[str]:
    """Why the first of the values that failed has no answer; nothing where none did."""
    failed = np.argwhere(chart.data["verdict"].to_numpy() == "failed")
    if not len(failed):
        return []
    places = zip(chart.paths, failed[0], strict=True)
    where = ", ".join(label_value(chart.scene, path, float(chart.data[path][i])) for path, i in places)
    return [f"Failed, first at {where}: {chart.data['reason'].to_numpy()[tuple(failed[0])]}."]


def label_value(scene: Scene, path: str, value: float) -> str:
    """A number of a scene at one of its values, with its unit."""
    return with_unit_of(scene, path, f"{name_number(path)} = {value:.4g}")


def describe_critical(scene: Scene, one: CriticalValue) -> str:
    """One critical value with unit, error, distance and resonance, as a sentence without its full stop."""
    change = "becomes unstable" if one.kind == "onset" else "is no longer unstable"
    if one.touching:
        change = "touches instability"
    size, away = (with_unit_of(scene, one.path, number) for number in (f"{one.value:.8g}", f"{one.distance:+.4g}"))
    what = f"{name_number(one.path)}: {change} at {size} ± {one.error:.0e} ({away} from the scene's own)"
    return f"{what}; {without_units(one.resonance)}"


def say_none_was_found(data: xarray.Dataset) -> list[str]:
    """Why there is no boundary, or no critical value: none is there, or the work has not come to its end."""
    if data.attrs.get("incomplete"):
        return [f"{data.attrs['incomplete']}."]
    if data.attrs.get("search"):
        return [f"Where the verdict changes was not searched to the end ({data.attrs['search']})."]
    kinds = set(np.unique(data["verdict"].to_numpy())) - {"failed", "missing"}
    if len(kinds) > 1:
        return ["The verdict changes between neighbouring values of different colour; no more exact place was found."]
    return ["The verdict does not change inside this range."]


def describe_distance(chart: Chart, nearest: Array) -> str:
    """How far the scene's own numbers are from the boundary."""
    moves, inside = list[str](), True
    for path, value, own in zip(chart.paths, nearest, chart.own, strict=True):
        moves.append(with_unit_of(chart.scene, path, f"{name_number(path)} {value - own:+.4g}"))
        inside &= bool(chart.data[path].min() <= own <= chart.data[path].max())
    where = "diamond" if inside else "outside this range"
    return f"From the scene's own numbers ({where}) to the nearest boundary: {', '.join(moves)}."


def make_wide_panel(x: Array, y: Linear, title: str, x_label: str, height: float) -> Panel:
    """A panel over the whole page and all of x."""
    return Panel(title, Linear(float(x.min()), float(x.max())), y, x_label, width=WIDTH, height=height)


def draw_line(label: str, own: float, data: xarray.Dataset, critical: Sequence[CriticalValue]) -> Panel:
    """All growth rates; the largest in the colour of its verdict; the unstable intervals shaded; critical values marked."""
    x = data[next(str(name) for name in data.coords)].to_numpy()
    growth, verdict = data["exponents"].real.to_numpy(), data["verdict"].to_numpy()
    scale = choose_scale(growth, data["error"].to_numpy())
    panel = make_wide_panel(x, scale, in_unit("growth rates", "1/s"), label, 300.0).zero()
    for interval in list_unstable(x, verdict, critical):
        panel.cells(interval, scale.ends, "unstable", 0.1)
    for k in range(1, growth.shape[1]):
        panel.line(x, growth[:, k], "faint", width=0.9, opacity=0.7, label="other exponents" if k == 1 else "")
    panel.line(x, growth[:, 0], "ink", width=0.8)
    for name in ("stable", "unstable", "undecided"):
        chosen = verdict == name
        if chosen.any():
            pairs = zip(x[chosen], growth[chosen, 0], strict=True)
            texts = [f"{a:.6g}: {with_unit(f'{b:.4g}', '1/s')}" for a, b in pairs]
            panel.dots(x[chosen], growth[chosen, 0], name, size=2.2, label=name, texts=texts)
    if (failed := verdict == "failed").any():
        panel.dots(x[failed], 0 * x[failed], "failed", "cross", 2.5, label="failed")
    mark_critical(panel, critical, scale)
    if x.min() <= own <= x.max():
        panel.line([own, own], [*scale.ends], "blue", width=1.2, dash="6 3", label=f"the scene: {own:.4g}")
    return panel


def list_unstable(x: Array, verdict: Array, critical: Sequence[CriticalValue]) -> list[tuple[float, float]]:
    """The intervals of instability, from the critical values, at which it begins and ends in turn."""
    edges = [one for one in critical if not one.touching]
    begins = edges[0].kind == "recovery" if edges else bool(verdict[0] == "unstable")
    ends = [float(x.min())] * begins + [one.value for one in edges]
    ends += [float(x.max())] * (len(ends) % 2)
    return list(zip(ends[::2], ends[1::2], strict=True))


def mark_critical(panel: Panel, critical: Sequence[CriticalValue], scale: Linear) -> None:
    """A line and a diamond at each critical value, and its figure; of those that would meet, the drawing keeps the first."""
    low, high = scale.ends
    for one in reversed(critical):
        panel.line([one.value, one.value], [low, high], "unstable", width=0.8, dash="3 2")
        text = f"{one.kind} at {one.value:.9g} ± {one.error:.0e}: {without_units(one.resonance)}"
        panel.dots([one.value], [0.0], "unstable", "diamond", 4.0, texts=[text])
        panel.words(one.value, high, f"{one.value:.5g}", "unstable", halo=True)


def thin(data: xarray.Dataset) -> xarray.Dataset:
    """The sweep itself where it is small; else blocks of neighbours, each with the numbers of its fastest growing value."""
    dims = [str(dim) for dim in data["verdict"].dims]
    most = CURVE_POINTS if len(dims) == 1 else 300  # cells of two pixels
    if max(data["verdict"].shape) <= most:
        return data
    size = {dim: -(-data.sizes[dim] // most) for dim in dims}
    growth = data["exponents"].real.max("mode").drop_vars(list(data.coords)).coarsen(size, boundary="pad")
    blocks = growth.construct({dim: (dim, f"{dim} within") for dim in dims}).fillna(-np.inf)
    fastest = blocks.argmax([f"{dim} within" for dim in dims])
    where = {}
    for dim, step in size.items():
        start = xarray.DataArray(np.arange(0, data.sizes[dim], step), dims=dim)
        where[dim] = (fastest[f"{dim} within"] + start).clip(max=data.sizes[dim] - 1)
    if len(dims) == 1:
        return data.isel(where)
    axes = {dim: thin_axis(data[dim].to_numpy(), step) for dim, step in size.items()}
    return data.isel(where).drop_vars(dims).assign_coords(axes)


def thin_axis(values: Array, step: int) -> Array:
    """The middle of each block of neighbours; the ends stay."""
    middle = values[np.minimum(np.arange(0, len(values), step) + step // 2, len(values) - 1)].copy()
    middle[0], middle[-1] = values[0], values[-1]
    return middle


CAMPBELL = (
    "Frequencies of the Floquet modes, each taken near the mode of the averaged equations that it comes from. Thin lines: multiples of "
    "the motion's frequency, halves dashed; a mode that meets k/2 of it may resonate (order k), two modes where their sum or "
    "difference meets a multiple."
)


def draw_campbell(label: str, data: xarray.Dataset, error: float) -> Picture:
    """Frequencies in Hz, unstable ones marked; whole multiples of the motion's frequency as lines, halves dashed."""
    x, motion = data["value"].to_numpy(), data["motion"].to_numpy() / (2 * np.pi)
    frequency, growth = data["frequency"].to_numpy() / (2 * np.pi), data["growth"].to_numpy()
    shown = np.isfinite(frequency) & (frequency > 0)
    top = 1.08 * float(frequency[shown].max(initial=float(np.nanmax(motion))))
    panel = make_wide_panel(x, Linear(0.0, top), in_unit("frequencies", "Hz"), label, 320.0)
    for k in range(1, 25):  # halves of the motion's frequency
        multiple = np.where(k * motion / 2 <= top, k * motion / 2, np.nan)
        if np.isfinite(multiple).any():
            panel.line(x, multiple, "faint", width=0.7 if k % 2 == 0 else 0.5, dash="" if k % 2 == 0 else "2 3")
            last = int(np.flatnonzero(np.isfinite(multiple))[-1])
            text = f"{k // 2}" if k % 2 == 0 else f"{k}/2"
            panel.words(float(x[last]), float(multiple[last]), text, anchor="end", halo=True)
    ordered = follow_lines(np.sort(frequency, axis=1)[:, ::2])
    for i in range(ordered.shape[1]):
        panel.line(x, ordered[:, i], SERIES[i % len(SERIES)], width=1.6)
    unstable = (growth > max(error, RATE_FLOOR)) & np.isfinite(frequency)
    row, mode = np.nonzero(unstable)
    if len(row):
        pairs = zip(frequency[row, mode], growth[row, mode], strict=True)
        texts = [f"frequency {with_unit(f'{f:.4g}', 'Hz')} grows by {with_unit(f'{g:.3g}', '1/s')}" for f, g in pairs]
        panel.dots(x[row], frequency[row, mode], "unstable", size=3.0, label="unstable", texts=texts)
    return make_picture("campbell", "Campbell diagram", CAMPBELL, [panel])


def follow_lines(values: Array) -> Array:
    """Values (V, k) with each row in the order in which the lines through the rows before go on: lines that cross go straight on."""
    found, known = values.copy(), np.flatnonzero(np.isfinite(values).all(axis=1))
    for k, row in enumerate(known[1:], start=1):
        last, before = found[known[k - 1]], found[known[max(k - 2, 0)]]
        cost = np.abs(2 * last[:, None] - before[:, None] - values[row])
        found[row] = values[row][assign(cost)]
    return found


MAP_HEIGHT, BAR_WIDTH = 430.0, 104.0
"""Of the map of a chart, and of the bar of colours beside it."""
SHADES = 14
"""Strengths of a colour: they follow the square root of the rate, so that slow growth is seen beside fast."""


def strengthen(shade: float) -> float:
    """How strong a colour is at one of its shades: the faintest can be seen."""
    faintest = 0.18
    return faintest + (1 - faintest) * shade / SHADES


def draw_map(chart: Chart, labels: list[str], data: xarray.Dataset) -> Sequence[Panel]:
    """A cell for each pair of values, contours, the boundary, the scene's own point, and a bar of colours."""
    axes = [data[path].to_numpy() for path in chart.paths]
    growth, verdict = data["exponents"].real.max("mode").to_numpy(), data["verdict"].to_numpy()
    x, y = (find_edges(axis) for axis in axes)
    panel = Panel("", Linear(x[0], x[-1]), Linear(y[0], y[-1]), labels[0], labels[1], height=MAP_HEIGHT)
    panel.width = WIDTH - GAP - BAR_WIDTH
    fill_cells(panel, x, y, growth, verdict)
    levels = draw_contours(panel, axes, growth, verdict)
    for curve in chart.curves:
        panel.line(curve.points[:, 0], curve.points[:, 1], "ink", width=1.5)
    for text, (across, up) in {shorten(curve.resonance): curve.inside for curve in reversed(chart.curves)}.items():
        panel.words(float(across + 0.02 * np.ptp(x)), float(up), text, "ink", anchor="start", halo=True)
    mark_scene(panel, chart.own, chart.nearest, axes)
    panel.probe(write_probe(labels, axes, growth, verdict))
    return [panel, draw_bar(growth, verdict, levels)]


def fill_cells(panel: Panel, x: Array, y: Array, growth: Array, verdict: Array) -> None:
    """Each cell in the colour of its verdict, the stronger the faster; undecided ones hatched, failed ones crossed."""
    for name in ("stable", "unstable", "undecided", "failed"):
        chosen = verdict == name
        shade = choose_shades(growth, chosen) if name in ("stable", "unstable") else np.zeros(growth.shape, dtype=int)
        for k in np.unique(shade[chosen]):
            i, j = np.nonzero(chosen & (shade == k))
            panel.cells((x[i], x[i + 1]), (y[j], y[j + 1]), name, strengthen(k))
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
    ticks = [(level, text) for level, text in scale.ticks(6) if level != 0] if scale.low != scale.high else []
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
    inner = known[(np.minimum(known - low, low + span - known) > 0.04 * span).all(axis=1)]
    known = inner if len(inner) else known
    if not placed:
        return np.asarray(known[len(known) // 2])
    apart = np.min([np.linalg.norm((known - other) / span, axis=1) for other in placed], axis=0)
    return np.asarray(known[apart.argmax()])


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
    panel = Panel(in_unit("growth rate", "1/s"), Named(0.0, 1.0), x_label="\u00a0")
    panel.width, panel.height = BAR_WIDTH, MAP_HEIGHT
    shown = growth[(verdict == "stable") | (verdict == "unstable")]
    low, high = float(min(shown.min(initial=0.0), 0.0)), float(max(shown.max(initial=0.0), 0.0))
    panel.y = Linear(low, high if high > low else low + 1.0)
    for name, end in (("stable", low), ("unstable", high)):
        edges = end * (np.arange(SHADES + 1) / SHADES) ** 2
        for k in range(SHADES if end else 0):
            panel.cells([0.0, 1.0], sorted(edges[k : k + 2]), name, strengthen(k + 0.5))
    for level in levels:
        panel.line([0.0, 1.0], [level, level], "ink", width=0.6, opacity=0.55)
    return panel


def write_probe(labels: list[str], axes: list[Array], growth: Array, verdict: Array) -> str:
    """What the page shows under the pointer, as JSON."""
    rates = [[None if not np.isfinite(value) else float(f"{value:.4g}") for value in row] for row in growth]
    x, y = (axis.tolist() for axis in axes)
    table = {"labels": labels, "x": x, "y": y, "growth": rates, "verdict": verdict.tolist()}
    return json.dumps({"unit": f" {page_unit('1/s')}".rstrip(), **table})


def find_edges(values: Array) -> Array:
    """The edges of the cells around increasing values: half-way between neighbours."""
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[values[0]], middle, [values[-1]]])


def trace_contour(x: Array, y: Array, values: Array, level: float) -> tuple[Array, Array]:
    """The contour as coordinates (N,), its pieces parted by values that are not a number.

    A cell with four crossings joins neighbours on its rim. Source: Lorensen, Cline, Marching cubes (1987), in the plane.
    """
    grid = np.array([*np.meshgrid(x, y, indexing="ij"), values - level])
    around = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]  # the corners of all cells, in turn
    rims = np.stack(around, axis=-1).reshape(3, -1, 4)
    ends = rims[:, np.isfinite(rims[2]).all(axis=1)]
    after = np.roll(ends, -1, axis=2)
    cut = (ends[2] > 0) != (after[2] > 0)
    first, second = ends[:, cut], after[:, cut]
    along, up = first[:2] + first[2] / (first[2] - second[2]) * (second[:2] - first[:2])
    pairs = (np.insert(one, np.arange(2, len(one) + 1, 2), np.nan) for one in (along, up))
    return next(pairs), next(pairs)
