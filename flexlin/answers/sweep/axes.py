"""The values of a sweep: which points they make, and whether the scene's schema takes them."""

from itertools import product

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError
from flexlin.scene.parameters import get_value
from flexlin.scene.revised import raw_tables, revise_scene
from flexlin.scene.scene import Scene

MOST_CHECKED = 10
"""Values of a path that are checked one by one; of more, both ends, the one nearest to zero, and so many in between."""
MOST_CORNERS = 6
"""Paths of a grid whose corners are checked together."""


def lay_out(axes: dict[str, Array], grid: bool) -> tuple[Array, tuple[int, ...], tuple[str, ...]]:
    """All points (V, P), the shape of the result and the names of its dimensions."""
    lengths = tuple(len(axis) for axis in axes.values())
    if not axes or 0 in lengths:
        raise ArgumentError("there is nothing to sweep", got=str(lengths), expected="at least one path with values")
    if grid:
        mesh = np.meshgrid(*axes.values(), indexing="ij")
        return np.stack([axis.ravel() for axis in mesh], axis=1), lengths, tuple(axes)
    if len(set(lengths)) > 1:
        raise ArgumentError(
            "the paths have different numbers of values", got=str(lengths), expected="one number, or grid=True"
        )
    return np.stack(list(axes.values()), axis=1), lengths[:1], ("value",)


def check_axes(scene: Scene, axes: dict[str, Array], grid: bool) -> None:
    """Refuse values that the scene's schema refuses, each path by itself and the corners of a grid together, before any computation.

    Raises: SceneError with the key.
    """
    raw = raw_tables(scene)
    for path, values in axes.items():
        get_value(scene, path)
        for value in pick_values(values):
            revise_scene(scene, {path: value}, raw)
    if grid and 1 < len(axes) <= MOST_CORNERS:
        for corner in product(*[(axis.min(), axis.max()) for axis in axes.values()]):
            revise_scene(scene, dict(zip(axes, map(float, corner), strict=True)), raw)


def pick_values(values: Array) -> list[float]:
    """All values of a path, or of many those that an interval, perhaps without zero, would refuse first."""
    distinct = np.unique(values)
    if len(distinct) <= MOST_CHECKED:
        return list(map(float, distinct))
    away = distinct[distinct != 0]
    few = distinct[np.linspace(0, len(distinct) - 1, MOST_CHECKED).round().astype(int)]
    return [float(away[np.abs(away).argmin()]), *map(float, few)]


def check_values(count: int, states: int = 2) -> None:
    """Refuse a sweep of too many values before anything is allocated for them."""
    check_size(f"a sweep of {count} values", count * (16 * states + 60), "ask for fewer values")
