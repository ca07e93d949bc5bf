"""Which number of the scene moves which exponent: exact derivatives, all parameters at once."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.linearization.free import ParametricLoop, parametric_loop
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import FloquetModes, differentiate_exponents, floquet_modes
from flexlin.periodic.transition.gauss import CHUNK_BYTES
from flexlin.scene.parameters import get_value, numeric_paths
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    import xarray as xr


FREE_TABLES = ("links.", "effects.", "motion.", "control.")
BOUND = ("motion.move_time", "motion.dwell_time", "rate")
"""Ends of paths whose numbers fix the grid of the period and are not varied unless they are asked for."""


@checked
def sensitivity(scene: Scene, paths: Sequence[str] | None = None, tol: float = 1e-8) -> "xr.Dataset":
    """Differentiate every Floquet exponent of the scene's own loop by numbers of the scene.

        d lambda / d theta = (1/T) int_0^T q^H (dA/dtheta + (T'/T) A) p dt - lambda T'/T,   dA/dtheta at fixed phase,
        A = [[0, I], [-M^-1 K, -M^-1 D]],   d(M^-1 K) = M^-1 (dK - dM M^-1 K)

    dM, dD, dK by automatic differentiation of the expressions: no difference is taken. Assumes simple exponents (`condition` is large
    where two nearly coincide) and mode shapes as the scene's own numbers give them.

    Parameters
    ----------
    scene : Scene
        The scene.
    paths : sequence of str, optional
        Dotted paths; by default all numbers of links, effects, motion and control that may be free and are not zero.
    tol : float
        Wanted error of the exponents, in 1/s.

    Returns
    -------
    xarray.Dataset
        exponents (mode) in 1/s, condition (mode), derivative (parameter, mode) in 1/s per unit of the number, value (parameter), and
        percent (parameter, mode): what one percent more of the number does to the growth rate, in 1/s.

    Raises
    ------
    ArgumentError
        For a path that leads to no free number.

    References
    ----------
    Seyranian, Mailybaev, Multiparameter Stability Theory with Mechanical Applications (2003), section 9.3.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> found = fl.sensitivity(scene, ["control.feedback.kd.0"], tol=1e-6)
    >>> found["derivative"].dims, found["value"].values.tolist()
    (('parameter', 'mode'), [0.5])
    """
    paths = choose_paths(scene) if paths is None else tuple(paths)
    if not paths:
        raise ArgumentError("no parameter to differentiate by", expected="at least one dotted path")
    loop = parametric_loop(scene, paths)
    system = loop.linearization.periodic_system()
    modes = floquet_modes(system, floquet(system, tol))
    derivative = integrate_derivatives(loop, modes)
    percent = derivative.real * loop.nominal[:, None] / 100
    import xarray as xr

    return xr.Dataset(
        {
            "exponents": ("mode", modes.exponents, {"units": "1/s"}),
            "condition": ("mode", modes.condition),
            "derivative": (("parameter", "mode"), derivative),
            "percent": (("parameter", "mode"), percent, {"units": "1/s"}),
            "value": ("parameter", loop.nominal),
        },
        coords={"parameter": list(paths)},
        attrs={"title": scene.title, "tol": tol},
    )


def choose_paths(scene: Scene) -> tuple[str, ...]:
    """All numbers of links, effects, motion and control that may be free and are not zero."""
    paths = [path for path in numeric_paths(scene) if path.startswith(FREE_TABLES) and not path.endswith(BOUND)]
    return tuple(path for path in paths if get_value(scene, path) != 0)


def integrate_derivatives(loop: ParametricLoop, modes: FloquetModes) -> Array:
    """The derivatives (P, n), the mean over the period taken chunk by chunk of its nodes; -lambda T'/T enters once."""
    p, states = loop.duration.sx_in()[0], len(modes.exponents)
    slope_of_duration = ca.Function("slope", [p], [ca.densify(ca.jacobian(loop.duration(p), p))])
    stretch = symbolic.evaluate(slope_of_duration, loop.nominal[None])[0][0, 0]
    used = np.flatnonzero(modes.weights)
    size = max(1, CHUNK_BYTES // (8 * (len(loop.paths) + 1) * 3 * states**2))
    total = -modes.exponents * stretch[:, None] / modes.period
    for k in (used[i : i + size] for i in range(0, len(used), size)):
        some = {name: getattr(modes, name)[k] for name in ("times", "weights", "right", "left")}
        part = replace(modes, **some, exponents=np.zeros_like(modes.exponents))
        A, slope = differentiate_state_matrix(loop, part.times / modes.period)
        total = total + differentiate_exponents(part, slope, A, stretch)
    return total


def differentiate_state_matrix(loop: ParametricLoop, phases: Array) -> tuple[Array, Array]:
    """A (N, 2n + k, 2n + k) and its derivatives (P, N, 2n + k, 2n + k) by the parameters, at fixed phases.

    A = [0 I 0; -M^-1 S],   S = [K, D] without the columns of the k ignorable coordinates, whose rates are a controller's states
    """
    phase, p = loop.matrices.sx_in()
    M, D, K = loop.matrices.call([phase, p])
    blocks = [M, ca.horzcat(K[:, : loop.linearization.n], D)]
    outputs = [*blocks, *(ca.jacobian(block, p) for block in blocks)]
    function = ca.Function("slopes", [phase, p], [ca.densify(one) for one in outputs])
    M, S, *J = symbolic.evaluate(function, phases[:, None], np.tile(loop.nominal, (len(phases), 1)))
    dM, dS = (unfold_slopes(slopes, one) for slopes, one in zip(J, (M, S), strict=True))
    n, states = loop.linearization.n, loop.states
    X = np.linalg.solve(M, S)
    A, slope = np.zeros((len(phases), states, states)), np.zeros((len(loop.paths), len(phases), states, states))
    A[:, :n, n : 2 * n] = np.eye(n)
    A[:, n:], slope[..., n:, :] = -X, -np.linalg.solve(M, dS - dM @ X)
    return A, slope


def unfold_slopes(J: Array, block: Array) -> Array:
    """Derivatives (P, N, rows, columns) of a block (N, rows, columns) from its Jacobian (N, rows columns, P), column by column."""
    count, rows, columns = block.shape
    return np.moveaxis(J.reshape(count, columns, rows, J.shape[-1]), (3, 0, 2, 1), (0, 1, 2, 3))
