"""Stability over one or two scene parameters: what is drawn, and what is said under it."""

from collections.abc import Sequence

import numpy as np
import xarray

from flexlin.answers.critical_values import CriticalValue
from flexlin.answers.stability_boundary import BoundaryCurve
from flexlin.checks import Array
from flexlin.report.figures.chart_line import draw_line
from flexlin.report.figures.chart_map import draw_map
from flexlin.report.figures.style import Picture
from flexlin.report.thinning import thin
from flexlin.report.wording import in_unit, without_units
from flexlin.scene.names import label_number, name_number, show_unit
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene

TITLE = "Stability chart"
LOOPS = {"own": "the scene's own loop", "open": "the arm without feedback"}


def draw_chart(
    scene: Scene,
    data: xarray.Dataset,
    critical: Sequence[CriticalValue] = (),
    curves: Sequence[BoundaryCurve] = (),
) -> Picture:
    """The growth rates over one parameter as lines, the largest over two as a map with the boundary and its resonances."""
    paths = list_paths(data)
    loop = name_drawn_loop(str(data.attrs.get("loop", "own")))
    title = f"{TITLE} of {loop}"
    caption = write_caption(data["verdict"].to_numpy(), loop)
    labels = [label_number(scene, path) for path in paths]
    own = [float(get_value(scene, path)) for path in paths]
    if len(paths) == 1:
        found = [f"{line}." for line in list_critical(scene, critical)] or say_none_was_found(data)
        said = "\n".join([caption, *found])
        return Picture("chart", title, said, draw_line(labels[0], own[0], thin(data), critical, title))
    nearest = find_nearest(own, data, paths, curves)
    inside = all(data[path].min() <= value <= data[path].max() for path, value in zip(paths, own, strict=True))
    said = describe_distance(scene, paths, own, nearest, inside) if nearest is not None else say_none_was_found(data)[0]
    shade = f"Stronger: faster growth or decay; lines of equal {in_unit('growth rate', '1/s')}; hatched: undecided."
    svg = draw_map(labels, own, nearest, thin(data), curves, title)
    return Picture("chart", title, f"{caption} {shade}\n{said}", svg)


def list_paths(data: xarray.Dataset) -> list[str]:
    """The dotted paths of a sweep's parameters."""
    dims = [str(path) for path in data["verdict"].dims]
    return [next(str(name) for name in data.coords)] if dims == ["value"] else dims


def name_drawn_loop(loop: str) -> str:
    """Which loop is drawn, in words."""
    return LOOPS.get(loop, f"the loop with {loop}")


def write_caption(verdict: Array, loop: str) -> str:
    """How many values are what."""
    kinds = ("stable", "unstable", "undecided", "failed", "missing")
    counts = ", ".join(
        f"{int((verdict == name).sum())} {name}" for name in kinds if name not in kinds[3:] or name in verdict
    )
    return (
        f"{loop[0].upper()}{loop[1:]} at {verdict.size} values: {counts}. "
        "Green: stable; red: unstable; amber: undecided, the growth rate is zero to within its error."
    )


def list_critical(scene: Scene, critical: Sequence[CriticalValue]) -> list[str]:
    """Each critical value as a sentence without its full stop."""
    return [describe_critical(scene, one) for one in critical]


def describe_critical(scene: Scene, one: CriticalValue) -> str:
    """One critical value with unit, error, distance and resonance."""
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
    """Why there is no boundary, or no critical value: none is there, or the search has not come to its end."""
    if data.attrs.get("search"):
        return [f"Where the verdict changes was not searched to the end: {data.attrs['search']}."]
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
