"""What a balance at equally spaced times leaves out between them: friction that a joint passes through in less time."""

import numpy as np

from flexlin.about.harmonic_balance import Solver, size_of
from flexlin.about.layers import THICK, Layers
from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries, fourier_basis, waves_at_nodes
from flexlin.periodic.grid import place_edges
from flexlin.periodic.resolved.sampling import graded

FINER = 16
"""Samples for each point, among which passages are looked for."""
PANELS, NODES, STEP = 64, 16, 3.0
"""Panels of a period and Gauss nodes in each; ratio of neighbouring panels about a passage."""


def find_passages(layers: Layers, y: FourierSeries, points: int) -> Array:
    """Edges about the times at which an argument goes through zero or comes near it, graded from the time it takes there."""
    T = y.period
    t = T * np.arange(-1, points * FINER + 1) / (points * FINER)
    values = layers.arguments(t, y(t), y(t, 1))
    edges = [np.empty(0)]
    for one in values.T:
        size, moved = np.abs(one), np.abs(np.diff(one))
        fastest = np.maximum(moved[1:], moved[:-1])
        low = (size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:]) & (size[1:-1] - fastest < THICK) & (fastest > 0)
        for i in np.flatnonzero(low) + 1:
            slope = (one[i + 1] - one[i - 1]) / (t[i + 1] - t[i - 1])
            crosses = one[i + 1] * one[i - 1] < 0
            width = (t[1] - t[0]) / fastest[i - 1]
            edges.append(graded([t[i] - one[i] / slope if crosses else t[i]], min(width, T / 8), T / 8, STEP))
    return np.mod(np.concatenate(edges), T)


def passes_unseen(layers: Layers, motion: FourierSeries, points: int) -> bool:
    """Whether a motion [y, ...] passes through a layer in less time than lies between so many points."""
    t, n = motion.period * np.arange(points + 1) / points, layers.about.n
    return bool(layers.hurry(t[None], motion(t)[None, :, :n], motion(t, 1)[None, :, :n])[0] > 1)


def miss_between(solver: Solver, layers: Layers, values: Array) -> float:
    """How far y moves, to first order and relative to its size, when the equations hold for their Fourier coefficients instead.

    F between the points, with every passage resolved, onto the polynomials of N terms by quadrature; the Jacobian is that of the points.
    Parameters: values: the solution (N, n + m + k).
    """
    n, N, k, T = solver.about.n, solver.points, solver.law.memory, solver.about.motion.period
    series = FourierSeries.through(values, T)
    edges = place_edges(T, find_passages(layers, FourierSeries.through(values[:, :n], T), N), PANELS)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    h = np.diff(edges)[:, None]
    t, weights = (edges[:-1, None] + h * (nodes + 1) / 2).ravel(), (h * weights / 2).ravel()
    left = solver.left(t, series)
    left[:, left.shape[1] - k :] += series(t, 1)[:, left.shape[1] - k :]
    onto = 2 * fourier_basis(t / T, N // 2).T @ (weights[:, None] * left) / T
    onto[0] /= 2
    projected = waves_at_nodes(N, N // 2) @ onto
    jacobian = solver.residual(values, 1.0)[1]
    moved = np.linalg.solve(jacobian, projected.ravel()).reshape(values.shape)[:, :n]
    return float(np.abs(moved).max() / size_of(values[:, :n]))
