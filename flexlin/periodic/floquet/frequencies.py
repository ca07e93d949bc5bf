"""Frequencies of Floquet modes without the ambiguity of 2 pi / T: each followed from the averaged system."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.circle import count_turns, match_logs, measure_distances, wrap_log
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.product.eigenvalues import product_logs
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choice import choose_setting
from flexlin.periodic.transition.gauss import gauss_transitions
from flexlin.periodic.transition.setting import place_segments

FIRST_STEP, LEAST_STEP = 1 / 8, 2.0**-14
STRIDE = 0.5
"""A step is halved when an exponent moves by more than this part of the distance to its nearest neighbour (plus LOCKED)."""
LOCKED = 0.02
"""Exponents this close (as logs of multipliers) have met: they may move together or apart without a halved step."""

TRACKED = 1e-6
"""Accuracy of the exponents on the way."""


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
    mean = system.resolved.mean()
    resolved = int(np.isfinite(result.errors).sum())
    start = np.linalg.eigvals(mean).astype(complex)
    start = start[np.argsort(-start.real, kind="stable")][:resolved]
    track, logs, e, step = start * T, start * T, 0.0, FIRST_STEP
    while e < 1:
        step = min(step, 1 - e)
        target = solve_between(system, e + step, result)[:resolved]
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


def solve_between(system: PeriodicSystem, e: float, result: FloquetResult) -> Array:
    """Logs of the multipliers of the system between its average (e = 0) and itself (e = 1)."""
    if e == 1:
        return result.log_multipliers
    A, mean = system.resolved, system.resolved.mean()
    setting = choose_setting(system, TRACKED, "gauss", None, None)
    between = gauss_transitions(
        lambda t: (1 - e) * mean + e * A(t), place_segments(system, setting), setting.order // 2
    )
    return product_logs(between)


def measure_isolation(logs: Array) -> Array:
    """Distance of each log to its nearest neighbour modulo 2 pi i."""
    size = measure_distances(logs, logs)
    np.fill_diagonal(size, np.inf)
    return size.min(axis=1)
