"""Stability over many values of scene parameters: the same equations for all values, evaluated in bounded batches."""

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from flexlin.about.free import ParametricLoop
from flexlin.answers.loops import choose_loop
from flexlin.answers.sweep.axes import check_axes, check_values, lay_out
from flexlin.answers.sweep.batches import CHUNK_BYTES, Batches, choose_plan
from flexlin.answers.sweep.found import Found, build_dataset
from flexlin.checks import positive, real_array
from flexlin.errors import ArgumentError
from flexlin.progress import advance
from flexlin.scene.scene import Scene

DESIGN_TOL = 1e-9
"""Gains of designs are at least as accurate as this."""


def sweep(
    scene: Scene,
    values: Mapping[str, ArrayLike],
    tol: float = 1e-8,
    *,
    grid: bool = False,
    loop: str = "own",
    chunk_bytes: int = CHUNK_BYTES,
) -> xr.Dataset:
    """Compute the Floquet exponents of a loop on a scene's arm for many values of the scene's numbers.

        M(t, p) y'' + D(t, p) y' + K(t, p) y = 0,   T = T(p),   for p = p_1 ... p_V

    Assumes mode shapes as the scene's own numbers give them.

    Parameters
    ----------
    scene : Scene
        The scene.
    values : mapping of str to array_like, shape (V,)
        Dotted path -> values; one point of the sweep for each index.
    tol : float
        Wanted error of an exponent, in 1/s up to |exponent| = 1/s and relative beyond.
    grid : bool
        Every combination of the values, with one dimension for each path.
    loop : str
        "own": the scene's loop; "open": the arm without feedback; a design's name: its gain as designed with the scene's own numbers, kept
        while they vary, as a function of the phase; "NAME, redone": designed anew at each value.
    chunk_bytes : int
        Working memory of a batch, in bytes. A batch holds one value at the least.

    Returns
    -------
    xarray.Dataset
        exponents (..., n) in 1/s by falling real part, error (...) in 1/s (the largest of a value's exponents), verdict, period in s,
        reason (why a verdict is undecided, or failed because the equations break there; else empty), and one_by_one: whether the value
        was left to `floquet`; attrs: loop, tol, segments, one_by_one (how many).

    Raises
    ------
    ArgumentError
        For paths and values that do not fit, and for a loop that is not there.
    SceneError
        For a value that the scene's schema refuses, with its key, before anything is computed.

    Notes
    -----
    The expressions are derived once. Coefficients are sampled at a few phases and carried to the nodes by their Fourier series;
    transition matrices and exponents of all values of a batch are found together, with an error from three resolutions. Values on
    which that error misses tol are computed again one by one by `floquet`. The result takes about 16 n + 60 bytes a value for n states.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> found = fl.sweep(scene, {"effects.payload.mass": [0.0, 0.03, 0.06]}, tol=1e-6)
    >>> found["verdict"].values.tolist(), found["exponents"].shape
    (['stable', 'stable', 'stable'], (3, 6))
    >>> bool((found["error"] < 1e-6 * abs(found["exponents"]).max("mode")).all())
    True
    """
    tol = positive("tol", tol)
    axes = {path: real_array(path, value, (None,)) for path, value in values.items()}
    if any(path.startswith("accuracy.") for path in axes):
        got, expected = ", ".join(axes), "a number of the links, effects, motion or control"
        raise ArgumentError("what is asked of the answer is no number of the arm", got=got, expected=expected)
    count = math.prod(map(len, axes.values())) if grid else max(map(len, axes.values()), default=0)
    check_values(count)
    points, shape, dims = lay_out(axes, grid)
    check_axes(scene, axes, grid)
    chosen = choose_loop(scene, axes, loop, min(tol, DESIGN_TOL))
    check_values(count, chosen.states)
    found, segments = Found.empty(len(points), chosen.states), 0
    if isinstance(chosen, ParametricLoop):
        batches = Batches(chosen, points, tol, chunk_bytes)
        plan = choose_plan(batches)
        segments, size = plan.segments, batches.values_in_chunk(plan.segments)
        for start in range(0, len(points), size):
            advance(start / len(points))
            batches.fill(found, np.arange(start, min(start + size, len(points))), plan)
    else:
        for i, point in enumerate(points):
            advance(i / len(points))
            found.put_alone(i, partial(chosen.system_at, point), tol)
    return build_dataset(scene, axes, found, shape, dims, {"loop": loop, "tol": tol, "segments": segments})
