"""The circle: angles modulo 2 pi, logarithms modulo 2 pi i, and how two sets of them are paired."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexlin.checks import Array


def count_turns(angle: Array) -> Array:
    """Return the whole turns k for which angle - 2 pi k lies in (-pi, pi]."""
    return np.ceil(angle / (2 * np.pi) - 0.5)


def wrap_angle(angle: Array) -> Array:
    """Bring angles into (-pi, pi]; one that lies there already keeps all its digits."""
    near = angle - 2 * np.pi * count_turns(angle)
    return np.where(near > np.pi, near - 2 * np.pi, np.where(near <= -np.pi, near + 2 * np.pi, near))


def wrap_log(log: Array) -> Array:
    """Bring the imaginary parts of logarithms, or of differences of logarithms, into (-pi, pi]."""
    return log.real + 1j * wrap_angle(log.imag)


def measure_distances(logs: Array, others: Array) -> Array:
    """Return |log_i - other_j| modulo 2 pi i, (n, m, ...), for logs (n, ...) and others (m, ...)."""
    apart = logs[:, None] - others[None, :]
    return np.hypot(apart.real, wrap_angle(apart.imag))


def match_logs(logs: Array, others: Array) -> tuple[Array, Array]:
    """Pair two sets of n logs one to one, nearest first, modulo 2 pi i: the index of each partner and its distance."""
    size = measure_distances(logs, others)
    partner = size.argmin(axis=1)
    if len(set(partner.tolist())) < len(logs):
        free = size.copy()
        for _ in range(len(logs)):
            i, j = np.unravel_index(free.argmin(), free.shape)
            partner[i] = j
            free[i, :] = free[:, j] = np.inf
    return partner, size[np.arange(len(logs)), partner]


def pair_conjugates(logs: Array, errors: Array) -> tuple[Array, Array]:
    """Make logs of a real system's multipliers conjugate in pairs or real (0 or pi) exactly, where they are so up to their errors (n,)."""
    partner, apart = match_logs(logs, logs.conj())
    with np.errstate(invalid="ignore"):
        near = apart <= 2 * np.maximum(errors, errors[partner]) + 1e-12
    mutual = (partner[partner] == np.arange(len(logs))) & near
    mate = logs[partner].conj()
    middle = wrap_log(logs + wrap_log(mate - logs) / 2)
    alone = partner == np.arange(len(logs))
    angle = np.where(np.abs(middle.imag) < np.pi / 2, 0.0, np.pi)
    paired = np.where(alone, middle.real + 1j * angle, middle)
    return np.where(mutual, paired, logs), np.where(mutual, np.maximum(errors, errors[partner]), errors)


def assign(cost: Array) -> Array:
    """The column of each row (n,) such that the sum of the costs (n, m), n <= m, is least.

    Each row takes its cheapest column; where that does not do, SciPy assigns by shortest augmenting paths. Its sparse matching, which
    loads faster, may turn in a circle for ever where differences of costs are lost in rounding.
    """
    cheapest = cost.argmin(axis=1)
    if len(np.unique(cheapest)) == len(cost):
        return cheapest
    return np.asarray(linear_sum_assignment(np.where(np.isfinite(cost), cost, np.inf))[1])
