"""Fast modes: which family of methods carries them at the least cost."""

import math

from flexlin.errors import ToleranceNotReached
from flexlin.periodic.floquet.refinement import Level, compute_levels, measure_excess
from flexlin.periodic.product.balancing import GROUP_CONDITION
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import Setting, count_radau_segments, measure_rates

LOOSE = 1e-8
"""Above this tolerance order 4 is tried first, below it order 6."""
PILOT = 256
"""Segments of Gauss collocation beyond which the Magnus series is tried."""


def try_magnus(
    system: PeriodicSystem, gauss_plan: Setting, tol: float, max_segments: int
) -> tuple[Setting, list[Level]]:
    """Try the Magnus series, which is exact on the constant part, where Gauss collocation would need many segments.

    Returns the plan of least work and, where that is a Magnus method, the levels of its trial: refinement goes on from there.
    """
    rate, spread, top = measure_rates(system)
    least = math.ceil(system.period * spread / math.log(GROUP_CONDITION))
    if least > max_segments:
        count = 4 * count_radau_segments(system.period, top)
        return Setting("radau", 9, count, "modes that decay too fast to be resolved are only bounded"), []
    best, plan, trial = gauss_plan, gauss_plan, list[Level]()
    for order in (4, 6) if tol > LOOSE else (6, 4):
        pilot = Setting("magnus", order, max(PILOT, least), "the Magnus series carries fast modes exactly", rate)
        if pilot.segments <= max_segments and pilot.work(system.n) < best.work(system.n):
            try:
                levels = compute_levels(system, pilot)
            except ToleranceNotReached:
                continue
            excess = max(1.0, measure_excess(pilot, levels, tol, system.period))
            promised = pilot.with_segments(math.ceil(pilot.segments * excess ** (1 / order)))
            if promised.work(system.n) < best.work(system.n):
                best, plan, trial = promised, pilot, levels
            if promised.segments <= 2 * pilot.segments:
                break
    return plan, trial
