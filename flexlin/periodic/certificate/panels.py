"""A(t) and X(t) as polynomials on common panels of the period, with what the polynomials of A may be off."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.chebyshev import chebyshev_basis, chebyshev_coefficients, panel_times
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import WAVES, ResolvedMatrix, divided

NODES, TAIL = 32, 4
"""Nodes of a panel, and how many of its last coefficients must have vanished."""
MOST = 512
"""Panels of a period."""
SLOW_TO_SETTLE = 3
"""Halvings after which at most half of the panels, and no more than at the beginning, may be rough."""
KNOWN, SHAPED = 1e-11, 1e-6
"""How small the last coefficients of A and of X must be, relative to their largest values."""
FAINT = 0.02
"""Coefficients of A that are left out and counted as error, relative to what is not known anyway."""
LEAST = 1e-8
"""Coefficients of X that are left out, in units in which X has a diagonal of ones."""
EPS = float(np.finfo(float).eps)
Resolved = ResolvedMatrix | ResolvedCompanion


@dataclass(frozen=True)
class CommonPanels:
    """Edges (P + 1,) from 0 to T, Chebyshev coefficients of A and X (P, K, n, n), and a bound on the error of A's entries (n, n)."""

    edges: Array
    A: Array
    X: Array
    error: Array


def represent_on_panels(resolved: Resolved, X: Callable[[Array], Array], most: int = MOST) -> CommonPanels:
    """Interpolate A and X on panels that are halved until both are followed; what was followed is not looked at again.

    Raises: ToleranceNotReached when that takes more panels than `most`, and more than the period begins with.
    """
    longest = WAVES * resolved.period / max(resolved.degree, 1)
    edges = resolved.edges
    if isinstance(resolved.series, FourierSeries):
        edges = divided(edges, min(longest, resolved.period))
    begin, end = edges[:-1], edges[1:]
    followed, most = list[tuple[Array, Array, Array]](), max(most, len(begin))
    sizes, unknown = [np.zeros(1), np.zeros(1)], FAINT * error_of(resolved).ravel()
    while len(begin):
        if len(begin) + sum(len(start) for start, _, _ in followed) > most:
            raise ToleranceNotReached("A and X were not followed by polynomials", got=f"more than {most} panels")
        t = panel_times(begin, end, NODES)
        parts = [f(t.ravel()).reshape(*t.shape, -1) for f in (resolved, X)]
        sizes = [np.maximum(old, np.abs(values).max(axis=(0, 1))) for old, values in zip(sizes, parts, strict=True)]
        A, shape = (chebyshev_coefficients(values) for values in parts)
        rough = is_rough(A, np.maximum(KNOWN * sizes[0], unknown)) | is_rough(shape, SHAPED * sizes[1])
        followed.append((begin[~rough], A[~rough], shape[~rough]))
        begin, end = begin[rough], end[rough]
        begin, end = np.concatenate([begin, (begin + end) / 2]), np.concatenate([(begin + end) / 2, end])
    starts, A, shape = (np.concatenate(each) for each in zip(*followed, strict=True))
    order = np.argsort(starts)
    return assemble(resolved, np.append(starts[order], edges[-1]), A[order], shape[order])


def is_rough(coefficients: Array, allowed: Array) -> Array:
    """Which panels' last coefficients (P, K, E) exceed what is allowed (E,)."""
    return np.any(np.abs(coefficients[:, -TAIL:]).max(axis=1) > allowed, axis=1)


def assemble(resolved: Resolved, edges: Array, A: Array, X: Array) -> CommonPanels:
    """Put panels together; A's error: that of its representation, what the panels add between their nodes, and rounding."""
    n = round(A.shape[-1] ** 0.5)
    A, X = (one.reshape(*one.shape[:2], n, n) for one in (A, X))
    X = (X + np.swapaxes(X, -1, -2)) / 2
    u = np.linspace(-1.0, 1.0, 2 * NODES + 1)[1:-1]
    t = (edges[:-1, None] + edges[1:, None]) / 2 + np.diff(edges)[:, None] / 2 * u
    apart = np.abs(
        resolved(t.ravel()).reshape(*t.shape, n, n) - np.einsum("uk,pkij->puij", chebyshev_basis(u, NODES), A)
    )
    between = 3 * apart.max(axis=(0, 1)) + np.abs(A[:, -TAIL:]).sum(axis=1).max(axis=0)
    units = np.sqrt(np.abs(X[..., range(n), range(n)]).sum(axis=1).max(axis=0))
    error = error_of(resolved) + between + 8 * EPS * np.abs(A).sum(axis=1).max(axis=0)
    kept = trimmed(A, FAINT * error)
    error = error + np.abs(A[:, kept.shape[1] :]).sum(axis=1).max(axis=0)
    return CommonPanels(
        edges, kept, trimmed(X, LEAST * np.outer(units, units)), np.where(np.any(A, axis=(0, 1)), error, 0.0)
    )


def error_of(resolved: Resolved) -> Array:
    """A bound on the error of A's representation (n, n); of second order:

        |dA| <= 1.5 |M^-1| (|dM| |M^-1 K| + |dK|)   and with D in the place of K,

    at 257 times, with half as much again for between them.
    """
    if isinstance(resolved, ResolvedMatrix):
        return resolved.error
    t = resolved.period * np.arange(257) / 257
    M, D, K = resolved.sample(t)
    dM, dD, dK = resolved.split(resolved.blocks.error)
    inverse = np.abs(np.linalg.inv(M))
    sides = [
        (inverse @ (dM @ np.abs(np.linalg.solve(M, one)) + error)).max(axis=0) for one, error in ((K, dK), (D, dD))
    ]
    lower = 1.5 * np.concatenate(sides, axis=1)
    return np.concatenate([np.zeros_like(lower), lower])


def trimmed(coefficients: Array, least: Array) -> Array:
    """Coefficients without the highest ones, where those are at most `least` (n, n) on every panel."""
    counts = np.flatnonzero(np.any(np.abs(coefficients) > least, axis=(0, 2, 3)))
    return coefficients[:, : int(counts.max(initial=0)) + 1]
