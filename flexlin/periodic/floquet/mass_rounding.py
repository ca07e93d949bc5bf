"""What the rounding of a nearly singular mass matrix does to the exponents: measured by rounding it once more."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import match_logs
from flexlin.periodic.product.eigenvalues import EPS, draw_noise, product_spectrum
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import Setting, factor_period

SUSPECT = 1e5
"""Condition number of the scaled mass matrix above which its rounding is looked at."""
ROUNDINGS = 8.0


def measure_mass_rounding(system: PeriodicSystem, setting: Setting, logs: Array) -> Array:
    """How far the logs of the multipliers move when M is perturbed by a few roundings, (n,); zero where M is well conditioned.

    M -> M o (1 + ROUNDINGS eps E) with E symmetric and random: an entry of M is never known better than to its rounding, and
    M^-1 multiplies that by the condition number of M (scaled to a unit diagonal).
    """
    second = system.second_order
    if second is None or measure_mass_condition(second.M(system.period * np.array([0.0, 0.37, 0.71]))) < SUSPECT:
        return np.zeros(len(logs))
    n = len(logs) // 2
    E = draw_noise((n, n))
    factor = 1 + ROUNDINGS * EPS * (E + E.T)

    def M(t: Array) -> Array:
        return second.M(t) * factor

    rough = PeriodicSystem.from_second_order(M, second.D, second.K, system.period, breaks=system.breaks)
    return match_logs(logs, product_spectrum(factor_period(rough, setting)[1], probes=0).logs)[1]


def measure_mass_condition(M: Array) -> float:
    """The largest condition number of M scaled to a unit diagonal."""
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diagonal(M, axis1=1, axis2=2)), np.finfo(float).tiny))
    return float(np.linalg.cond(M * scale[:, :, None] * scale[:, None, :]).max())
