"""Undamped systems: is x' = A(t) x Hamiltonian, and are its exponents paired (lambda, -lambda) as they must be?"""

import numpy as np
from numpy.polynomial.legendre import leggauss

from flexlin.checks import Array
from flexlin.periodic.circle import match_logs, wrap_log
from flexlin.periodic.second_order import SecondOrder
from flexlin.periodic.system import PeriodicSystem

TOLERANCE = 1e-10
"""Relative deviation from symmetry that still counts as symmetric."""
PANELS, NODES = 12, 10
"""Where the symmetry is looked at; the derivative of M comes from the interpolant on the nodes of a panel."""


def is_hamiltonian(system: PeriodicSystem) -> bool:
    """Whether the flow keeps a symplectic form.

        first order:   J A(t) symmetric, J = [[0, I], [-I, 0]]
        second order:  M and K - G'/2 symmetric, G = D - M' skew   (then p = M y' + G y / 2 is the momentum)

    M', G' are those of the interpolant on Gauss nodes, so an undamped system that varies very fast may be missed.
    Source: Yakubovich, Starzhinskii, Linear Differential Equations with Periodic Coefficients (1975), ch. III.
    """
    x = (leggauss(NODES)[0] + 1) / 2
    corners = np.unique(np.concatenate([np.linspace(0, system.period, PANELS + 1), system.breaks]))
    h = np.diff(corners)
    t = (corners[:-1, None] + h[:, None] * x).ravel()
    if system.second_order is not None:
        return is_symmetric_motion(system.second_order, t, h)
    n = system.n // 2
    if system.n != 2 * n:
        return False
    A = system.A(t)
    JA = np.concatenate([A[:, n:], -A[:, :n]], axis=1)
    return is_symmetric(JA)


def is_symmetric_motion(second: SecondOrder, t: Array, h: Array) -> bool:
    """The conditions of second order on samples at the nodes of panels of lengths h."""
    M, D, K = second.sample(t)
    G = D - differentiate_panels(M, h)
    scale = np.abs(D).max() + np.sqrt(np.abs(M).max() * np.abs(K).max())
    skew = np.abs(G + np.swapaxes(G, 1, 2)).max() <= 10 * TOLERANCE * scale
    return bool(skew and is_symmetric(M) and is_symmetric(K - differentiate_panels(G, h) / 2))


def differentiate_panels(values: Array, h: Array) -> Array:
    """The derivative of the interpolants on the panels, (N, n, n)."""
    x = (leggauss(NODES)[0] + 1) / 2
    V = np.vander(x, increasing=True)
    slope = np.column_stack([np.zeros(NODES), V[:, :-1] * np.arange(1, NODES)])
    matrix = np.linalg.solve(V.T, slope.T).T
    panels = values.reshape(len(h), NODES, *values.shape[1:])
    return (np.einsum("ij,pj...->pi...", matrix, panels) / h.reshape(-1, 1, 1, 1)).reshape(values.shape)


def is_symmetric(values: Array) -> bool:
    """Whether matrices (N, n, n) are symmetric to within TOLERANCE of their largest entry."""
    return bool(np.abs(values - np.swapaxes(values, 1, 2)).max() <= TOLERANCE * np.abs(values).max())


def pair_hamiltonian(logs: Array) -> tuple[Array, Array]:
    """Make logs of multipliers exactly paired, log mu -> -log mu, and return by how much each missed its pair.

    (l_i - l_j) / 2 for each i and the partner j nearest to -l_i, imaginary parts modulo 2 pi
    """
    partner, violation = match_logs(-logs, logs)
    mutual = partner[partner] == np.arange(len(logs))
    return wrap_log(logs + np.where(mutual, wrap_log(-logs[partner] - logs) / 2, 0)), violation
