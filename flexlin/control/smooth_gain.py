"""A computed gain as one smooth series: what the loop, its judges and exports read."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.chebyshev import ChebyshevPanels, chebyshev_coefficients, panel_times
from flexlin.periodic.coefficients import Constant, MatrixFunction
from flexlin.periodic.fourier import FourierSeries, fourier_nodes, waves_at_nodes
from flexlin.periodic.quadratic.solution import RiccatiSolution
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.sampling import stratified

COUNTS = (32, 64, 128, 256, 512)
"""Nodes that are tried: of the period, or of each interval between breaks."""
CHECKS, BETTER = 97, 3.0
"""Times at which series and gain are compared, and the factor by which more nodes must come nearer to be worth it."""

WITHIN = np.array([0.003, 0.03, 0.13, 0.25, 0.39, 0.51, 0.61, 0.74, 0.87, 0.96, 0.993])
"""Where in each panel, too: a gain that rounding moves has corners where its polynomials meet."""

EPS = float(np.finfo(float).eps)
MOST_WAVES = 200
"""Harmonics of a gain that is made in one product."""
ROUNDED = 16 * EPS
"""What rounding makes of a gain by two Fourier transforms."""

Series = FourierSeries | ChebyshevPanels


def smooth_gain(K: MatrixFunction, breaks: tuple[float, ...], panels: Array) -> tuple[Series, float]:
    """Represent a gain by the shortest series that follows it as well as its own errors allow.

    A gain from a Riccati equation is smooth but for the errors of its solution, which K = R^-1 B' X may amplify. More nodes
    are taken while they come nearer; what is left over is those errors.

    Parameters: K: times (N,) -> (N, m, n); breaks: times in [0, T) at which K is not smooth; panels: edges from 0 to T between which a
    polynomial follows it: in each of them the series is compared with K.
    Returns: the series, and the largest deviation from K relative to the largest gain.
    """
    edges = np.unique([0.0, *breaks, panels[-1]])
    t = np.concatenate([inside(edges, stratified(CHECKS)), inside(panels, WITHIN)])
    wanted = K(t)
    size = float(np.abs(wanted).max()) or 1.0
    best, least = interpolate_gain(K, edges, breaks, COUNTS[0]), np.inf
    for count in COUNTS:
        series = interpolate_gain(K, edges, breaks, count)
        apart = float(np.abs(series(t) - wanted).max()) / size
        if apart * BETTER > least:
            break
        best, least = series, apart
    return best, least


def transform_gain(solution: RiccatiSolution) -> tuple[FourierSeries, float] | None:
    """The gain of a smooth solution as the Fourier series that it is, where B is one too and R and N are constant; else None.

        K = R^-1 (B' X + N'),   as many harmonics as B and X have together

    Returns: the series, and what is left out and rounded, relative to the largest gain.
    """
    problem, X = solution.problem, solution.series
    B = problem.B.series if isinstance(problem.B, ResolvedMatrix) else problem.B
    if not isinstance(problem.R, Constant) or not isinstance(problem.N, Constant) or not isinstance(X, FourierSeries):
        return None
    if isinstance(B, Constant):
        B = FourierSeries(B.value[None], X.period)
    if not isinstance(B, FourierSeries) or X.degree + B.degree > MOST_WAVES:
        return None
    H = X.degree + B.degree
    count, effort = 2 * H + 1, np.linalg.inv(problem.R.value)
    values = (B.at_nodes(count) @ effort).swapaxes(1, 2) @ X.at_nodes(count) + effort @ problem.N.value.T
    rest = (values - values[0]).reshape(count, -1)  # constants are not rounded
    parts = (2 / count) * (waves_at_nodes(count, H).T @ rest)
    parts[0] *= 0.5
    size, heights = float(np.abs(values).max()) or 1.0, np.abs(parts).max(axis=1)
    left = np.append(np.maximum(heights[1 : H + 1], heights[H + 1 :])[::-1].cumsum()[::-1], 0.0)
    kept = int(np.count_nonzero(left > EPS * size))
    parts[0] += values[0].ravel()
    parts = np.concatenate([parts[: kept + 1], parts[H + 1 : H + 1 + kept]])
    return FourierSeries(parts.reshape(-1, *values.shape[1:]), X.period), float(left[kept] / size) + ROUNDED


def inside(edges: Array, parts: Array) -> Array:
    """Times at these parts of each interval."""
    return np.asarray((edges[:-1, None] + np.diff(edges)[:, None] * parts).ravel())


def interpolate_gain(K: MatrixFunction, edges: Array, breaks: tuple[float, ...], count: int) -> Series:
    """The trigonometric interpolant on N nodes (an odd number), or Chebyshev's on N nodes between breaks."""
    if not breaks:
        return FourierSeries.through(K(fourier_nodes(count - 1, float(edges[-1]))), float(edges[-1]))
    t = panel_times(edges[:-1], edges[1:], count)
    values = K(t.ravel())
    flat = chebyshev_coefficients(values.reshape(*t.shape, -1))
    return ChebyshevPanels(edges, flat.reshape(*t.shape, *values.shape[1:]))
