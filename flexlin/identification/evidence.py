"""What a fit knows: covariance, numbers that cannot be parted, colour of residuals."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.identification.least_squares import Point, Problem, eliminate

UNKNOWN = 1.0
"""Standard deviation of a direction, numbers in units of their own size, from which on the log does not know it."""
SHARE = 0.2
"""Share of such a direction from which on a number belongs to it."""
TOGETHER = 0.9
"""Correlation that is worth a word."""
WHITE = 4.0
"""Correlation of neighbours, in standard deviations of that of white noise, from which on residuals are coloured."""
BLOCKS = 4
"""Blocks of a window whose sums show how coloured residuals add up."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """The numbers that are known, their errors, covariance (k, k) and large correlations; groups of numbers that are not; numbers at a
    limit; the correlation of neighbouring residuals of each column, and whether that is colour."""

    known: tuple[str, ...]
    errors: dict[str, float]
    covariance: Array
    correlations: dict[str, float]
    unknown: tuple[tuple[str, ...], ...]
    limited: tuple[str, ...]
    colour: Array
    coloured: bool


def weigh_evidence(problem: Problem, point: Point, paths: list[str]) -> Evidence:
    """Covariance (J' J)^-1 of the numbers with the starting states taken out; C S C of coloured residuals, S from sums over blocks."""
    size, windows = point.start.shape[1], len(point.start)
    slopes, residual = problem.slopes(point), point.residual.reshape(windows, -1)
    rest = eliminate(slopes, residual, size, np.full(windows, 1e-12))[3][:, : residual.shape[1], :-1]
    at_limit = (point.p <= problem.low + 1e-9) | (point.p >= problem.high - 1e-9)
    inside = np.flatnonzero(~at_limit)
    scale = np.where(point.p != 0, np.abs(point.p), 1.0)[inside]
    J = rest[:, :, inside] * scale
    values, V = np.linalg.eigh(np.einsum("wri,wrj->ij", J, J))
    deviation = 1 / np.sqrt(np.maximum(values, 1e-300))
    lost = deviation > UNKNOWN
    groups = group_directions(np.abs(V[:, lost]) > SHARE)
    out = sorted({i for group in groups for i in group})
    C = (V[:, ~lost] / values[~lost]) @ V[:, ~lost].T
    colour, coloured = find_colour(problem, point)
    if coloured:
        C = with_colour(C, J, residual, point.residual.shape)
    kept = [i for i in range(len(inside)) if i not in out]
    C = C[np.ix_(kept, kept)] * np.outer(scale[kept], scale[kept])
    errors = {paths[inside[i]]: float(np.sqrt(C[k, k])) for k, i in enumerate(kept)}
    unknown = tuple(tuple(paths[inside[i]] for i in group) for group in groups)
    limited = tuple(paths[k] for k in np.flatnonzero(at_limit))
    known = tuple(path for path in paths if path in errors or path in limited)
    whole = np.full((len(known), len(known)), np.nan)
    places = [known.index(path) for path in errors]
    whole[np.ix_(places, places)] = C
    every = {path: errors.get(path, float("nan")) for path in known}
    return Evidence(known, every, whole, name_correlations(list(errors), C), unknown, limited, colour, coloured)


def leave_unknown(problem: Problem, point: Point, paths: list[str]) -> Evidence:
    """Of a point at which no search has settled: its numbers, without a word on their errors."""
    errors, unsure = dict.fromkeys(paths, float("nan")), np.full((len(paths), len(paths)), np.nan)
    return Evidence(tuple(paths), errors, unsure, {}, (), (), find_colour(problem, point)[0], False)


def group_directions(members: Array) -> list[list[int]]:
    """Numbers that share a direction (columns), joined where two directions share a number."""
    groups: list[set[int]] = []
    for column in members.T:
        own = set(np.flatnonzero(column).tolist())
        apart = [group for group in groups if not group & own]
        groups = [*apart, own.union(*(group for group in groups if group & own))]
    return [sorted(group) for group in groups]


def with_colour(C: Array, J: Array, residual: Array, shape: tuple[int, ...]) -> Array:
    """The covariance of coloured residuals, from their scores over blocks; no variance is made smaller by it."""
    windows, samples, outputs = shape
    scores = (J * residual[:, :, None]).reshape(windows, samples, outputs, -1).sum(axis=2)
    edges = np.linspace(0, samples, BLOCKS + 1).astype(int)[:-1]
    sums = np.add.reduceat(scores, edges, axis=1).reshape(windows * BLOCKS, -1)
    wide = C @ (sums.T @ sums) @ C
    factor = np.sqrt(np.maximum(1.0, np.diag(wide) / np.maximum(np.diag(C), 1e-300)))
    return C * np.outer(factor, factor)


def find_colour(problem: Problem, point: Point) -> tuple[Array, bool]:
    """The correlation of neighbouring residuals of each column, and whether any is more than that of white noise."""
    r = point.residual
    both = np.sum(r[:, 1:] * r[:, :-1], axis=(0, 1))
    every = np.maximum(np.sum(r**2, axis=(0, 1)), 1e-300)
    count = np.count_nonzero(r, axis=(0, 1))
    found = both / every
    return found, bool(np.any(found > WHITE / np.sqrt(np.maximum(count, 1))))


def name_correlations(paths: list[str], C: Array) -> dict[str, float]:
    """Large correlations by the two paths."""
    error = np.sqrt(np.diag(C))
    found = C / np.outer(error, error) if len(C) else C
    pairs = [(i, j) for i in range(len(paths)) for j in range(i) if abs(found[i, j]) >= TOGETHER]
    return {f"{paths[j]}, {paths[i]}": float(found[i, j]) for i, j in pairs}
