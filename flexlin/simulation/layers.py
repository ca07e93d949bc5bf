"""Steps that pass over a layer of rates in which a resisting force saturates."""

from collections.abc import Callable

import numpy as np

from flexlin.about.layers import Layers
from flexlin.checks import Array
from flexlin.simulation.window import Grid, Path, between

PARTS = np.linspace(0.0, 1.0, 9)
"""Of a step: where the arguments of what saturates are looked at."""


def hurries(layers: Layers, grid: Grid, path: Path) -> Array:
    """`Layers.hurry` of the steps (K,) of a window; coordinates of a controller stand behind those of the arm."""
    t, n = grid.edges[:-1, None] + grid.h[:, None] * PARTS, layers.about.n
    x = between(grid, path, np.zeros((grid.count, grid.stages)), t.ravel())[0].reshape(*t.shape, -1)
    return layers.hurry(t, x[..., :n], x[..., x.shape[-1] // 2 :][..., :n])


def skips_layer(layers: Layers | None, begin: float, end: float, dense: Callable[[Array], Array]) -> bool:
    """Whether one step of an integrator with states [y; y'; ...] (.., N) between passed a layer too fast to see it."""
    if layers is None:
        return False
    t, n = begin + (end - begin) * PARTS, layers.about.n
    x = dense(t).T
    return bool(layers.hurry(t[None], x[None, :, :n], x[None, :, n : 2 * n])[0] > 1)
