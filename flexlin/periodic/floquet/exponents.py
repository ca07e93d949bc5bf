"""Floquet exponents of a periodic system, with their own error and a verdict that admits doubt."""

import numpy as np

from flexlin.checks import instance, positive, whole
from flexlin.periodic.circle import wrap_log
from flexlin.periodic.floquet.hamiltonian import is_hamiltonian, pair_hamiltonian
from flexlin.periodic.floquet.hill import hill_spectrum
from flexlin.periodic.floquet.liouville import measure_liouville_defect
from flexlin.periodic.floquet.mass_rounding import measure_mass_rounding
from flexlin.periodic.floquet.pilot import PILOT, try_magnus
from flexlin.periodic.floquet.refinement import Level, compute_levels, estimate_errors, refine_spectrum
from flexlin.periodic.floquet.result import FloquetResult, judge
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import MAX_SEGMENTS, Setting, choose_setting, report_too_many

FACTOR_BYTES = 2**29
"""The transition matrices of a period take at most this many bytes."""


def floquet(
    system: PeriodicSystem,
    tol: float = 1e-9,
    *,
    method: str = "auto",
    order: int | None = None,
    segments: int | None = None,
    max_segments: int = MAX_SEGMENTS,
) -> FloquetResult:
    """Compute the Floquet exponents of x' = A(t) x.

        Phi(T) = F_K ... F_1,   mu_i = eigenvalues of Phi(T),   lambda_i = log(mu_i) / T

    Assumes A smooth between the system's breaks. The product is never formed, so exponents far apart keep their digits.

    Parameters: tol: wanted error of an exponent, in 1/s up to |lambda| = 1/s and relative beyond;
    method: auto, gauss, magnus, radau or hill; order and segments: fix the resolution (no refinement then; order means harmonics for hill).
    Returns: FloquetResult. Working memory: about 5 sets of factors, 8 n^2 bytes a segment each (at most FACTOR_BYTES), and the
    chunks of `collocation`.
    Raises: ArgumentError; TooManySegments with the figure when tol needs more than max_segments, or than FACTOR_BYTES hold.
    """
    instance("system", system, PeriodicSystem, "make one: fl.PeriodicSystem(A, period), or lin.periodic_system()")
    tol = positive("tol", tol)
    order, segments = (None if v is None else whole(k, v) for k, v in (("order", order), ("segments", segments)))
    if method == "hill":
        return solve_by_hill(system, tol, order)
    max_segments = min(whole("max_segments", max_segments), FACTOR_BYTES // (8 * system.n**2))
    setting = choose_setting(system, tol, method, order, segments)
    levels: list[Level] = []
    if method == "auto" and segments is None and setting.segments > PILOT:
        setting, levels = try_magnus(system, setting, tol, max_segments)
    if setting.segments > max_segments:
        raise report_too_many(setting.segments, max_segments, tol)
    levels = levels or compute_levels(system, setting)
    if segments is None:
        levels = refine_spectrum(system, setting, levels, tol, max_segments)
    fine, setting = levels[-1], setting.with_segments(levels[-1].segments)
    errors = estimate_errors(levels[-3:], setting) + measure_mass_rounding(system, setting, fine.logs)
    if np.isfinite(errors).all():
        errors *= max(1.0, measure_liouville_defect(system, setting, fine.logs, errors) / errors.sum())
    logs, undamped = fine.logs, abs(fine.logs.real.sum()) <= errors.sum() and is_hamiltonian(system)
    if undamped:
        logs, violation = pair_hamiltonian(logs)
        errors = np.maximum(errors, violation)
    return judge(logs / system.period, errors / system.period, system.period, setting, tol, undamped)


def solve_by_hill(system: PeriodicSystem, tol: float, harmonics: int | None) -> FloquetResult:
    """The same exponents by the independent Fourier route, imaginary parts folded into (-pi/T, pi/T]."""
    spectrum = hill_spectrum(system, tol, harmonics)
    folded = wrap_log(spectrum.exponents * system.period) / system.period
    setting = Setting("hill", spectrum.harmonics, 1, "as asked")
    return judge(folded, spectrum.errors, system.period, setting, tol)
