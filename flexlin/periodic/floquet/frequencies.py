"""Frequencies of Floquet modes without the ambiguity of 2 pi / T: each followed from the averaged system."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.circle import count_turns, match_logs, measure_distances, wrap_log
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.grid import place_edges
from flexlin.periodic.product.eigenvalues import product_spectrum
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import gauss, place_nodes, sample_at
from flexlin.periodic.transition.setting import Setting, factor_period

FIRST_STEP, LEAST_STEP = 1 / 8, 2.0**-14
STRIDE = 0.5
"""A step is halved when an exponent moves by more than this part of the distance to its nearest neighbour (plus LOCKED)."""
LOCKED = 0.02
"""Exponents this close (as logs of multipliers) have met: they may move together or apart without a halved step."""


def track_frequencies(
    system: PeriodicSystem, result: FloquetResult | None = None, tol: float = 1e-9
) -> tuple[Array, Array]:
    """Unfold the imaginary parts of the exponents by following the modes from the averaged system.

        A_e(t) = (1 - e) mean A + e A(t),   e from 0 to 1

    At e = 0 the exponents are eigenvalues of mean A, whose frequencies are unambiguous; along e each is followed by nearness
    of the multiplier's log, with steps short against the distance between exponents. Two that meet in a resonance lock there.

    Exponents too fast to be resolved are not followed (nan).

    Returns: frequencies (n,) in rad/s in the order of `result.exponents`, equal to their imaginary parts modulo 2 pi / T,
    and the eigenvalues (n,) of mean A from which they come.
    Raises: ToleranceNotReached when exponents move too fast to be followed.
    """
    result = result or floquet(system, tol)
    T = system.period
    mean = average_matrix(system)
    resolved = int(np.isfinite(result.errors).sum())
    start = np.linalg.eigvals(mean).astype(complex)
    start = start[np.argsort(-start.real, kind="stable")][:resolved]
    track, logs, e, step = start * T, start * T, 0.0, FIRST_STEP
    while e < 1:
        step = min(step, 1 - e)
        target = solve_between(system, mean, e + step, result)[:resolved]
        partner, moved = match_logs(logs, target)
        if np.all(moved <= STRIDE * measure_isolation(logs) + LOCKED):
            turn = target[partner] - logs
            track = track + wrap_log(turn)
            logs, e, step = target[partner], e + step, 2 * step
        else:
            step /= 2
            if step < LEAST_STEP:
                raise ToleranceNotReached(
                    "the modes cannot be followed from the averaged system", got=f"stopped at e = {e:.4g}"
                )
    final = result.log_multipliers[:resolved]
    order = match_logs(final, logs)[0]
    turns = count_turns((track[order] - final).imag)
    hidden = np.full(len(result.exponents) - resolved, np.nan)
    frequencies = result.exponents[:resolved].imag + 2 * np.pi / T * turns
    return np.append(frequencies, hidden), np.append(start[order], hidden)


def average_matrix(system: PeriodicSystem) -> Array:
    """The mean of A over a period by Gauss quadrature between the breaks."""
    grid, rule = place_edges(system.period, system.breaks, 8), gauss(16)
    weights = np.diff(grid)[:, None] / system.period * rule.b
    return np.einsum("ks,ksij->ij", weights, sample_at(system.A, place_nodes(grid, rule.c)))


def solve_between(system: PeriodicSystem, mean: Array, e: float, result: FloquetResult) -> Array:
    """Logs of the multipliers of the system between its average (e = 0) and itself (e = 1)."""
    if e == 1:
        return result.log_multipliers
    between = PeriodicSystem(lambda t: (1 - e) * mean + e * system.A(t), system.period, breaks=system.breaks)
    setting = (
        result.setting
        if result.setting.method != "hill"
        else Setting("gauss", 12, 4 * result.setting.order, "tracking")
    )
    return product_spectrum(factor_period(between, setting)[1], probes=0).logs


def measure_isolation(logs: Array) -> Array:
    """Distance of each log to its nearest neighbour modulo 2 pi i."""
    size = measure_distances(logs, logs)
    np.fill_diagonal(size, np.inf)
    return size.min(axis=1)
