"""Exponents for scans, at half the work of `floquet`: only Liouville's identity confirms a verdict that is beyond doubt."""

from dataclasses import replace

import numpy as np

from flexlin.periodic.floquet.exponents import FACTOR_BYTES, find_exponents
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.floquet.segmented import SegmentedSpectrum, liouville_excess, look_at_segments, solve_by_segments
from flexlin.periodic.product.spectrum import find_spectrum
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import MAX_SEGMENTS, METHODS, Setting, place_segments

FAR = 100.0
"""A log of a multiplier this many times its promised error away from the axis is on its side of it; roundings of a factor beyond doubt."""
LEAST = 1e-2
"""So is none that is nearer to the axis than this, whatever the setting promises."""


def glimpse(system: PeriodicSystem, tol: float) -> FloquetResult:
    """The exponents of `floquet`; by segments, the errors are those that the setting promises for tol, unless they leave the verdict open.

    For scans: they ask for a verdict, and solve again with evidence wherever it changes.
    """
    limit = min(MAX_SEGMENTS, FACTOR_BYTES // (8 * system.n**2))
    answer = find_exponents(system, tol, "auto", None, None, limit, glimpse_by_segments)
    return replace(answer, resolved=system.resolved)


def glimpse_by_segments(system: PeriodicSystem, setting: Setting, tol: float, max_segments: int) -> SegmentedSpectrum:
    """The first resolution without a second one, unless a mode is near the axis or the logs do not add up to the mean trace of A.

    Raises: TooManySegments.
    """
    grid = place_segments(system, setting)
    factors = METHODS[setting.method](system, grid, setting.order)
    found = find_spectrum(factors, middles=look_at_segments(system.resolved, grid)[0])
    logs = found.logs
    promised = tol * np.maximum(system.period, np.abs(logs))
    open_ = np.maximum(FAR * promised, LEAST)
    decided = bool(np.all(logs.real < -open_) or np.any(logs.real > open_))
    if setting.method != "gauss" or not decided or found.stretched or liouville_excess(system, logs, promised) > 0:
        return solve_by_segments(system, setting, tol, max_segments)
    return SegmentedSpectrum(logs, promised, np.zeros(len(logs)), setting, found.start)
