"""A computed gain as one smooth series: what the loop, its judges and exports read."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.chebyshev import ChebyshevPanels, chebyshev_coefficients, panel_times
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.fourier import FourierSeries, fourier_nodes
from flexlin.periodic.resolved.sampling import stratified

COUNTS = (32, 64, 128, 256, 512)
"""Nodes that are tried: of the period, or of each interval between breaks."""
CHECKS, BETTER = 97, 3.0
"""Times at which series and gain are compared, and the factor by which more nodes must come nearer to be worth it."""

WITHIN = np.array([0.13, 0.61])
"""Where in each panel, too."""

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
