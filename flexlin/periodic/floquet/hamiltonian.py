"""Undamped systems: is x' = A(t) x Hamiltonian, and are its exponents paired (lambda, -lambda) as they must be?"""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import match_logs, wrap_log
from flexlin.periodic.precision import FAINT
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.sampling import BLOCKS, stratified
from flexlin.periodic.system import PeriodicSystem


def is_hamiltonian(system: PeriodicSystem) -> bool:
    """Whether the flow keeps a symplectic form.

        first order:   J A(t) symmetric, J = [[0, I], [-I, 0]]
        second order:  M and K - G'/2 symmetric, G = D - M' skew   (then p = M y' + G y / 2 is the momentum)

    M', G' are those of the series.
    Source: Yakubovich, Starzhinskii, Linear Differential Equations with Periodic Coefficients (1975), ch. III.
    """
    resolved, t = system.resolved, system.period * stratified(BLOCKS)
    if isinstance(resolved, ResolvedCompanion):
        return is_symmetric_motion(resolved, t)
    n, odd = divmod(system.n, 2)
    A = resolved(t)
    return not odd and is_symmetric(np.concatenate([A[:, n:], -A[:, :n]], axis=1))


def is_symmetric_motion(resolved: ResolvedCompanion, t: Array) -> bool:
    """The conditions of second order on samples of the series and their derivatives at times t (N,)."""
    slope = resolved.series.derivative()
    M, D, K = resolved.sample(t)
    (dM, dD, _), (ddM, _, _) = (resolved.split(one(t)) for one in (slope, slope.derivative()))
    G = D - dM
    scale = np.abs(D).max() + np.sqrt(np.abs(M).max() * np.abs(K).max())
    skew = np.abs(G + np.swapaxes(G, 1, 2)).max() <= 10 * FAINT * scale
    return bool(skew and is_symmetric(M) and is_symmetric(K - (dD - ddM) / 2))


def is_symmetric(values: Array) -> bool:
    """Whether matrices (N, n, n) are symmetric to within rounding of their largest entry."""
    return bool(np.abs(values - np.swapaxes(values, 1, 2)).max() <= FAINT * np.abs(values).max())


def pair_hamiltonian(logs: Array) -> tuple[Array, Array]:
    """Make logs of multipliers exactly paired, log mu -> -log mu, and return by how much each missed its pair.

    (l_i - l_j) / 2 for each i and the partner j nearest to -l_i, imaginary parts modulo 2 pi
    """
    partner, violation = match_logs(-logs, logs)
    mutual = partner[partner] == np.arange(len(logs))
    return wrap_log(logs + np.where(mutual, wrap_log(-logs[partner] - logs) / 2, 0)), violation
