"""Liouville's identity: an independent look at the sum of the exponents."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.grid import place_edges
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import gauss, place_nodes, sample_at
from flexlin.periodic.transition.setting import Setting

QUADRATURE = 32
"""Gauss nodes in one panel of the trace integral: more accurate than the transition matrices on as many samples."""


def measure_liouville_defect(system: PeriodicSystem, setting: Setting, logs: Array, errors: Array) -> float:
    """How far the exponents miss Liouville's identity, sum_i log mu_i = int_0^T tr A dt (real parts), by Gauss quadrature.

    The sum of the errors cannot be less than this; where it is, the quadrature's own error is looked at and forgiven.
    """
    grid = place_edges(system.period, system.breaks, -(-setting.segments * setting.order // (2 * QUADRATURE)))
    integral = integrate_trace(system, grid, QUADRATURE)
    defect = abs(float(logs.real.sum()) - integral)
    if defect <= errors.sum():
        return defect
    return max(0.0, defect - abs(integral - integrate_trace(system, grid, QUADRATURE * 2 // 3)))


def integrate_trace(system: PeriodicSystem, grid: Array, stages: int) -> float:
    """int_0^T tr A dt by Gauss quadrature on the panels of the grid."""
    rule = gauss(stages)
    trace = np.trace(sample_at(system.A, place_nodes(grid, rule.c)), axis1=-2, axis2=-1)
    return float(np.diff(grid) @ (trace @ rule.b))
