"""Frequencies over one of a scene's numbers, without the ambiguity of the motion's frequency: the data of a Campbell diagram."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import linear_sum_assignment

from flexlin.analyses.loops import choose_loop
from flexlin.checks import Array
from flexlin.linearization.free import ParametricLoop
from flexlin.periodic.circle import wrap_angle
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    import xarray as xr


def unfold_frequencies(scene: Scene, path: str, data: "xr.Dataset", loop: str = "own") -> "xr.Dataset | None":
    """Add to the exponents of a sweep over one number whole multiples of the motion's frequency, so that each lies near a mode.

        omega = Im lambda + k 2 pi / T,   k such that omega is nearest to the frequency of a mode of the averaged equations

    Modes and exponents are paired one to one, least distance in all, and again with the averaged modes moved by the median of what they
    were off at 25 neighbouring values. Where two modes are nearer to each other than half the motion's
    frequency modulo that frequency, which is which may be exchanged.

    Parameters: data: of `sweep` over this number alone. Returns: frequency (value, mode) in rad/s, not negative, growth (value, mode), and
    motion (value), the motion's frequency; None for loops whose equations are not known as expressions.
    """
    chosen = choose_loop(scene, (path,), loop)
    if not isinstance(chosen, ParametricLoop):
        return None
    values = data[path].to_numpy()
    exponents, turn = data["exponents"].to_numpy(), 2 * np.pi / data["period"].to_numpy()
    averaged = find_averaged(chosen, values)
    known = np.flatnonzero(np.isfinite(exponents).all(axis=1) & np.isfinite(averaged).all(axis=1))
    frequency, shift = np.full(exponents.shape, np.nan), np.zeros(exponents.shape)
    for _ in range(2):
        for k in known:
            frequency[k], shift[k] = unfold(exponents[k], averaged[k], float(turn[k]))
        averaged = averaged + 1j * median_filter(shift, size=(25, 1), mode="nearest")
    import xarray as xr

    return xr.Dataset(
        {
            "frequency": (("value", "mode"), np.abs(frequency), {"units": "rad/s"}),
            "growth": (("value", "mode"), exponents.real, {"units": "1/s"}),
            "motion": ("value", turn, {"units": "rad/s"}),
        },
        coords={"value": values},
    )


def find_averaged(loop: ParametricLoop, values: Array) -> Array:
    """Eigenvalues (V, n) of the state matrix averaged over a period."""
    phases = np.arange(64) / 64
    M, D, K = loop.sample(phases, values[:, None])
    n, states = loop.coordinates - loop.memory, loop.states
    blocks = np.linalg.solve(M, np.concatenate([K[:, :, :n], D], axis=2)).reshape(len(phases), len(values), -1, states)
    A = np.zeros((len(values), states, states))
    A[:, :n, n : 2 * n], A[:, n:] = np.eye(n), -blocks.mean(axis=0)
    found = np.linalg.eigvals(A)
    order = np.lexsort((found.real, found.imag), axis=1)
    return np.take_along_axis(found, order, axis=1)


def unfold(exponents: Array, averaged: Array, turn: float) -> tuple[Array, Array]:
    """The imaginary parts (n,) nearest to those of the averaged modes, modulo `turn`, and how far off each averaged mode (n,) was."""
    apart = exponents[:, None] - averaged
    around = wrap_angle(apart.imag * 2 * np.pi / turn) * turn / (2 * np.pi)
    rows, columns = linear_sum_assignment(np.hypot(apart.real, around))
    result, shift = np.empty(len(exponents)), np.empty(len(exponents))
    result[rows] = averaged.imag[columns] + around[rows, columns]
    shift[columns] = around[rows, columns]
    return result, shift
