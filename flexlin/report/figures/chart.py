"""Over one or two scene parameters: growth rates as lines or a map, the Campbell diagram, and what is said under them."""

from collections.abc import Sequence

import numpy as np
import xarray

from flexlin.answers.critical_values import CriticalValue
from flexlin.answers.stability_boundary import BoundaryCurve
from flexlin.checks import Array
from flexlin.errors import counted
from flexlin.periodic.circle import assign
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Linear, Symlog
from flexlin.report.figures.chart_map import draw_map
from flexlin.report.figures.style import SERIES, WIDTH, Picture, make_picture
from flexlin.report.wording import in_unit, with_unit, without_units
from flexlin.scene.names import label_number, name_number, show_unit
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene

LOOPS = {"own": "the scene's own loop", "open": "the arm without feedback"}


def draw_chart(
    scene: Scene,
    data: xarray.Dataset,
    critical: Sequence[CriticalValue] = (),
    curves: Sequence[BoundaryCurve] = (),
) -> Picture:
    """The growth rates over one parameter as lines, the largest over two as a map with the boundary and its resonances."""
    paths = list_paths(data)
    title = f"Stability chart of {name_drawn_loop(data)}"
    said = describe_chart(scene, data, critical, curves)
    labels, own = [label_number(scene, path) for path in paths], own_values(scene, paths)
    if len(paths) == 1:
        return make_picture("chart", title, said, [draw_line(labels[0], own[0], thin(data), critical)])
    nearest = find_nearest(own, data, paths, curves)
    return make_picture("chart", title, said, draw_map(labels, own, nearest, thin(data), curves))


def describe_chart(
    scene: Scene,
    data: xarray.Dataset,
    critical: Sequence[CriticalValue] = (),
    curves: Sequence[BoundaryCurve] = (),
) -> str:
    """What is said below a chart, a line for each thing; it holds without the picture too."""
    paths = list_paths(data)
    caption = write_caption(data["verdict"].to_numpy(), name_drawn_loop(data))
    bending = [data.attrs["bending"]] if data.attrs.get("bending") else []
    if len(paths) == 1:
        found = [f"{describe_critical(scene, one)}." for one in critical] or say_none_was_found(data)
        return "\n".join([caption, *found, *bending])
    own = own_values(scene, paths)
    nearest = find_nearest(own, data, paths, curves)
    inside = all(data[path].min() <= value <= data[path].max() for path, value in zip(paths, own, strict=True))
    said = "" if nearest is None else describe_distance(scene, paths, own, nearest, inside) + " "
    if nearest is None or data.attrs.get("search"):
        said += say_none_was_found(data)[0]
    shade = f"Stronger: faster growth or decay; lines of equal {in_unit('growth rate', '1/s')}; hatched: undecided."
    return "\n".join([f"{caption} {shade}", said, *bending])


def own_values(scene: Scene, paths: Sequence[str]) -> list[float]:
    """The scene's own numbers at dotted paths."""
    return [float(get_value(scene, path)) for path in paths]


def list_paths(data: xarray.Dataset) -> list[str]:
    """The dotted paths of a sweep's parameters."""
    dims = [str(path) for path in data["verdict"].dims]
    return [next(str(name) for name in data.coords)] if dims == ["value"] else dims


def name_drawn_loop(data: xarray.Dataset) -> str:
    """Which loop is drawn, in words."""
    loop = str(data.attrs.get("loop", "own"))
    return LOOPS.get(loop, f"the loop with {loop}")


def write_caption(verdict: Array, loop: str) -> str:
    """How many values are what."""
    kinds = ("stable", "unstable", "undecided", "failed", "missing")
    counts = ", ".join(
        f"{int((verdict == name).sum())} {name}" for name in kinds if name not in kinds[3:] or name in verdict
    )
    return (
        f"{loop[0].upper()}{loop[1:]} at {counted(verdict.size, 'value')}: {counts}. "
        "Green: stable; red: unstable; amber: undecided, the growth rate is zero to within its error."
    )


def describe_critical(scene: Scene, one: CriticalValue) -> str:
    """One critical value with unit, error, distance and resonance, as a sentence without its full stop."""
    unit = show_unit(scene, one.path)
    change = "becomes unstable" if one.kind == "onset" else "is stable again"
    if one.touching:
        change = "touches instability"
    size, resonance = f"{one.value:.8g} {unit}".strip(), without_units(one.resonance)
    return f"{name_number(one.path)}: {change} at {size} ± {one.error:.0e} ({one.distance:+.4g} from the scene's own); {resonance}"


def find_nearest(
    own: list[float], data: xarray.Dataset, paths: list[str], curves: Sequence[BoundaryCurve]
) -> Array | None:
    """The point of the boundary nearest to the scene's own, both axes counted as shares of their ranges."""
    if not curves:
        return None
    span = np.array([np.ptp(data[path].to_numpy()) for path in paths])
    points = np.concatenate([curve.points for curve in curves])
    return np.asarray(points[np.linalg.norm((points - own) / span, axis=1).argmin()])


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


def describe_distance(scene: Scene, paths: list[str], own: list[float], nearest: Array, inside: bool) -> str:
    """How far the scene's own numbers are from the boundary."""
    moves = [
        f"{name_number(path)} {value - mine:+.4g} {show_unit(scene, path)}".strip()
        for path, value, mine in zip(paths, nearest, own, strict=True)
    ]
    where = "diamond" if inside else "outside this range"
    return f"From the scene's own numbers ({where}) to the nearest boundary: {', '.join(moves)}."


WIDE = 30.0
"""Rates whose sizes span more than this are drawn on a scale of decades."""
NOISE, FLOOR = 20.0, 1e-6
"""Errors, and 1/s, below which differences of growth rates are not drawn larger."""
APART, BELOW = 0.08, 0.05
"""Of the width: labels of critical values closer than this are left out; of the height: how far below the top they stand."""


def draw_line(label: str, own: float, data: xarray.Dataset, critical: Sequence[CriticalValue]) -> Panel:
    """All growth rates; the largest in the colour of its verdict; the unstable intervals shaded; critical values marked."""
    x = data[next(str(name) for name in data.coords)].to_numpy()
    growth, verdict = data["exponents"].real.to_numpy(), data["verdict"].to_numpy()
    scale = choose_scale(growth, data["error"].to_numpy())
    panel = Panel(
        in_unit("growth rates", "1/s"),
        x=Linear(float(x.min()), float(x.max())),
        y=scale,
        x_label=label,
        width=WIDTH,
        height=300.0,
    ).zero()
    for begin, end in list_unstable(x, verdict, critical):
        low, high = scale.ends
        panel.cells((np.array([begin]), np.array([end])), (np.array([low]), np.array([high])), "unstable", 0.1)
    for k in range(1, growth.shape[1]):
        panel.line(x, growth[:, k], "faint", width=0.9, opacity=0.7, label="other exponents" if k == 1 else "")
    panel.line(x, growth[:, 0], "ink", width=0.8)
    for name in ("stable", "unstable", "undecided"):
        chosen = verdict == name
        if chosen.any():
            texts = [
                f"{a:.6g}: {with_unit(f'{b:.4g}', '1/s')}" for a, b in zip(x[chosen], growth[chosen, 0], strict=True)
            ]
            panel.dots(x[chosen], growth[chosen, 0], name, size=2.2, label=name, texts=texts)
    mark_critical(panel, critical, x, scale)
    mark_own(panel, own, x, scale)
    return panel


def choose_scale(growth: Array, error: Array) -> Linear:
    """Decades where the rates differ much, else equal steps; never finer than the errors of the rates."""
    known = growth[np.isfinite(growth)]
    noise = max(NOISE * float(np.nan_to_num(error).max(initial=0.0)), FLOOR)
    low, high = float(known.min(initial=0.0)), float(known.max(initial=0.0))
    sizes = np.abs(known[np.abs(known) > noise])
    if sizes.size and sizes.max() > WIDE * sizes.min():
        near = 10.0 ** np.floor(np.log10(max(sizes.min(), noise, sizes.max() * 1e-6)))
        return Symlog(near=float(near)).fitted(np.array([low, high, -near, near]))
    room = max(0.08 * (high - low), 2 * noise)
    return Linear(low - room, high + room)


def list_unstable(x: Array, verdict: Array, critical: Sequence[CriticalValue]) -> list[tuple[float, float]]:
    """The intervals of instability, from the critical values."""
    edges = [one for one in critical if not one.touching]
    begin = (
        float(x.min()) if (edges and edges[0].kind == "recovery") or (not edges and verdict[0] == "unstable") else None
    )
    found = []
    for one in edges:
        if one.kind == "onset":
            begin = one.value
        elif begin is not None:
            found.append((begin, one.value))
            begin = None
    return found if begin is None else [*found, (begin, float(x.max()))]


def mark_critical(panel: Panel, critical: Sequence[CriticalValue], x: Array, scale: Linear) -> None:
    """A line and a diamond at each critical value, and its figure where there is room."""
    low, high = scale.ends
    last = -np.inf
    for one in critical:
        panel.line([one.value, one.value], [low, high], "unstable", width=0.8, dash="3 2")
        text = f"{one.kind} at {one.value:.9g} ± {one.error:.0e}: {without_units(one.resonance)}"
        panel.dots([one.value], [0.0], "unstable", "diamond", 4.0, texts=[text])
        if one.value - last > APART * np.ptp(x):
            top = high if isinstance(scale, Symlog) else high - BELOW * (high - low)
            panel.words(one.value, top, f"{one.value:.5g}", "unstable", halo=True)
            last = one.value


def mark_own(panel: Panel, own: float, x: Array, scale: Linear) -> None:
    """The scene's own value, where it lies inside the range."""
    if x.min() <= own <= x.max():
        low, high = scale.ends
        panel.line([own, own], [low, high], "blue", width=1.2, dash="6 3", label=f"the scene: {own:.4g}")


MOST = {1: 2000, 2: 300}
"""Values along an axis of a picture, by the number of axes: about two a pixel, and two pixels a cell."""


def thin(data: xarray.Dataset) -> xarray.Dataset:
    """The sweep itself where it is small; else blocks of neighbours, each with the numbers of its fastest growing value."""
    dims = [str(dim) for dim in data["verdict"].dims]
    most = MOST[len(dims)]
    if max(data["verdict"].shape) <= most:
        return data
    size = [-(-n // most) for n in data["verdict"].shape]
    chosen = find_fastest(np.nan_to_num(data["exponents"].real.max("mode").to_numpy(), nan=-np.inf), size)
    if len(dims) == 1:
        return data.isel({dims[0]: chosen[0].ravel()})
    where = {dim: xarray.DataArray(index, dims=dims) for dim, index in zip(dims, chosen, strict=True)}
    axes = {dim: thin_axis(data[dim].to_numpy(), step) for dim, step in zip(dims, size, strict=True)}
    return data.isel(where).drop_vars(dims).assign_coords(axes)


def find_fastest(growth: Array, size: list[int]) -> tuple[Array, ...]:
    """The indices of the largest value of each block of `size` neighbours."""
    blocks = [-(-n // step) for n, step in zip(growth.shape, size, strict=True)]
    padded = np.full([count * step for count, step in zip(blocks, size, strict=True)], -np.inf)
    padded[tuple(slice(n) for n in growth.shape)] = growth
    cut = padded.reshape([part for pair in zip(blocks, size, strict=True) for part in pair])
    order = [*range(0, cut.ndim, 2), *range(1, cut.ndim, 2)]
    inner = np.unravel_index(cut.transpose(order).reshape(*blocks, -1).argmax(axis=-1), size)
    starts = np.meshgrid(*(np.arange(count) * step for count, step in zip(blocks, size, strict=True)), indexing="ij")
    return tuple(
        np.minimum(start + offset, n - 1) for start, offset, n in zip(starts, inner, growth.shape, strict=True)
    )


def thin_axis(values: Array, step: int) -> Array:
    """The middle of each block of neighbours; the ends stay."""
    middle = values[np.minimum(np.arange(0, len(values), step) + step // 2, len(values) - 1)].copy()
    middle[0], middle[-1] = values[0], values[-1]
    return middle


MULTIPLES = 12
"""Multiples of the motion's frequency that are drawn."""
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
    panel = Panel(
        in_unit("frequencies", "Hz"),
        x=Linear(float(x.min()), float(x.max())),
        y=Linear(0.0, top),
        x_label=label,
        width=WIDTH,
        height=320.0,
    )
    for k in range(1, 2 * MULTIPLES + 1):
        multiple = np.where(k * motion / 2 <= top, k * motion / 2, np.nan)
        if np.isfinite(multiple).any():
            panel.line(x, multiple, "faint", width=0.7 if k % 2 == 0 else 0.5, dash="" if k % 2 == 0 else "2 3")
            last = int(np.flatnonzero(np.isfinite(multiple))[-1])
            text = f"{k // 2}" if k % 2 == 0 else f"{k}/2"
            panel.words(float(x[last]), float(multiple[last]), text, anchor="end", halo=True)
    ordered = follow_lines(np.sort(frequency, axis=1)[:, ::2])
    for i in range(ordered.shape[1]):
        panel.line(x, ordered[:, i], SERIES[i % len(SERIES)], width=1.6)
    unstable = (growth > max(error, FLOOR)) & np.isfinite(frequency)
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
