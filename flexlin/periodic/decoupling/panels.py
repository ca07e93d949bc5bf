"""Transition matrices between the breaks of a periodic system, at a cost that does not depend on its fastest frequency."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebint

from flexlin.checks import Array
from flexlin.periodic.chebyshev import chebyshev_basis, chebyshev_nodes, chebyshev_transform
from flexlin.periodic.circle import match_logs
from flexlin.periodic.decoupling.decoupled import SAFETY, UNRESOLVED, DecoupledExponents, Refusal, as_real
from flexlin.periodic.decoupling.grouping import Group, find_eigenvectors, find_frame, follow_modes, grouped_modes
from flexlin.periodic.decoupling.parting import MAX_MERGES, MIXING, WORST
from flexlin.periodic.decoupling.superadiabatic import mixing, rounds, sylvester
from flexlin.periodic.decoupling.waves import apply
from flexlin.periodic.product.balancing import GROUP_CONDITION
from flexlin.periodic.product.spectrum import product_logs, solve_product
from flexlin.periodic.system import MatrixFunction
from flexlin.periodic.transition.gauss import gauss_transitions

NODES, CHECK_NODES = 36, 28
"""Chebyshev nodes a panel, and of the second construction that measures the error of the first."""
GAP = 20.0
"""Modes stay together where the gap between their eigenvalues times the panel's length falls below this."""
LEFT = 1e-7
"""Modes stay together that stay mixed by more after the rounds."""
MAX_FACTORS = 4000
KEPT = 2 / 3
"""The part of the Chebyshev coefficients that the filter keeps."""
DOUBTFUL = 1e-2
"""Error of a log beyond which it counts as unresolved beside others that are."""
STAGES, STEP = 8, 2.0
"""Gauss stages of a factor, and the largest product of its length and an eigenvalue."""


@dataclass(frozen=True, eq=False)
class Panel:
    """x = T(t) z on [start, stop] with z' = B(t) z, B block diagonal up to couplings that mix modes by `mixed`.

    frame and generator (N, n, n), complex, at Chebyshev nodes; groups: diagonal blocks; rounds made.
    """

    start: float
    stop: float
    frame: Array
    generator: Array
    groups: tuple[Group, ...]
    rounds: int
    mixed: float


def panel_exponents(A: MatrixFunction, period: float, breaks: tuple[float, ...] = ()) -> DecoupledExponents | Refusal:
    """Floquet exponents of x' = A(t) x where A is smooth between breaks, each with its error.

        Phi = T(t_k+1) diag exp(int B) T(t_k)^-1 over each segment,   exponents = log eigenvalues of the product / T

    Each panel between breaks is decoupled alone; no periodic continuation is asked for. The error is the motion of the exponents when
    all is done again on fewer nodes, with one round less, on fewer segments, and the rounding of the product. An exponent that is
    ill-conditioned beyond measuring gets the whole spread of real parts.

    Parameters
    ----------
    A : function (N,) -> (N, n, n), in 1/s.
    period : in s.
    breaks : times in [0, T) at which A jumps or is not smooth.

    Returns
    -------
    DecoupledExponents, or a Refusal where the modes of some panel do not part or too many factors would be needed.

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.periodic.decoupling.panels import panel_exponents
    >>> slow, fast = np.diag([-1.0, -50]), np.array([[-1.0, 3], [0, -400]])
    >>> answer = panel_exponents(lambda t: np.where(t[:, None, None] < 0.5, slow, fast), 1.0, (0.0, 0.5))
    >>> [round(float(value), 9) for value in answer.exponents.real]
    [-1.0, -225.0]
    """
    panels: list[tuple[Panel, Panel]] = []
    for a, b in pairwise(np.unique([0.0, *breaks, period])):
        fine = decouple_panel(A, a, b, NODES)
        if isinstance(fine, Refusal):
            return fine
        check = decouple_panel(A, a, b, CHECK_NODES, max(1, fine.rounds - 1))
        if isinstance(check, Refusal):
            return check
        panels.append((fine, check))
    counts = [panel_segments(fine) for fine, _ in panels]
    if sum(counts) > MAX_FACTORS:
        return Refusal(f"{sum(counts)} factors of the period would be needed")
    return product_exponents(panels, counts, period)


def product_exponents(panels: list[tuple[Panel, Panel]], counts: list[int], period: float) -> DecoupledExponents:
    """The exponents of the product of all panels' transition matrices, and their motion when the second of each pair is taken."""
    factors = np.concatenate([panel_transitions(p, k) for (p, _), k in zip(panels, counts, strict=True)])
    logs, rounding = solve_product(factors)
    check = [panel_transitions(p, max(1, 3 * k // 4)) for (_, p), k in zip(panels, counts, strict=True)]
    moved = match_logs(logs, product_logs(np.concatenate(check)))[1]
    parts = np.array([SAFETY * moved, np.zeros(len(moved)), 2 * rounding])
    hopeless = ~(parts.sum(axis=0) < UNRESOLVED)
    if hopeless.any():  # the two constructions are far apart: that a log moves by less may be chance
        hopeless = ~(parts.sum(axis=0) < DOUBTFUL)
    widest = np.pi + float(np.sum([real_spread(fine) for fine, _ in panels]))
    parts[0, hopeless] = np.maximum(parts[0, hopeless], widest)
    parts /= period
    return DecoupledExponents(logs / period, parts.sum(axis=0), *parts)


def decouple_panel(A: MatrixFunction, start: float, stop: float, count: int, most: int = 14) -> Panel | Refusal:
    """Decouple x' = A(t) x on an interval on which A is smooth."""
    half = (stop - start) / 2
    samples = A(start + half * (1 + chebyshev_nodes(count)))
    try:
        modes = follow_modes(find_eigenvectors(samples), closed=False)
    except np.linalg.LinAlgError:
        return Refusal("the eigenvectors of A(t) depend on each other at some time")
    together = np.abs(modes.values[:, :, None] - modes.values[:, None, :]).min(axis=0) < GAP / (stop - start)
    smooth, slope = filter_interval(count, KEPT)
    for _ in range(MAX_MERGES):
        columns, groups = grouped_modes(modes, together)
        T = apply(smooth, find_frame(modes.taken(columns), groups, count // 2)[0])
        B = np.linalg.solve(T, samples @ T - apply(slope, T) / half)
        S = sylvester(B, groups)
        made, share = 0, mixing(S)
        stuck = share > MIXING
        if not stuck.any():
            T, B, S, made = rounds(
                B,
                T,
                S,
                groups,
                lambda S: (apply(smooth, S), apply(slope, S) / half),
                lambda B, S: 1e12 * mixing(S),
                most,
            )
            share = mixing(S)
            stuck = share > LEFT
        if not stuck.any():
            return Panel(start, stop, T, B, groups, made, float(share.max()))
        stuck &= share >= WORST * share.max()
        together[np.ix_(columns, columns)] |= stuck | stuck.T
    return Refusal("the coupling between groups of modes does not shrink")


def real_spread(panel: Panel) -> float:
    """The integral over the panel of the difference between the largest and the smallest real part of the eigenvalues."""
    values = np.concatenate([np.linalg.eigvals(panel.generator[:, g.part, g.part]) for g in panel.groups], axis=1)
    return float((panel.stop - panel.start) * np.ptp(values.real, axis=1).max())


def panel_segments(panel: Panel) -> int:
    """Segments on which every group's own motion is slow and no two modes part by more than GROUP_CONDITION."""
    values = np.concatenate([np.linalg.eigvals(panel.generator[:, g.part, g.part]) for g in panel.groups], axis=1)
    size = [g.size for g in panel.groups]
    starts = [g.start for g in panel.groups]
    mean = np.repeat(np.add.reduceat(values, starts, axis=1) / size, size, axis=1)
    rate, spread = np.abs(values - mean).max(), np.ptp(values.real, axis=1).max()
    return int(np.ceil((panel.stop - panel.start) * max(rate / STEP, spread / np.log(GROUP_CONDITION)))) + 4


def panel_transitions(panel: Panel, segments: int) -> Array:
    """Real transition matrices (segments, n, n) of x over equal parts of the panel."""
    count, half = len(panel.frame), (panel.stop - panel.start) / 2
    x = np.linspace(-1, 1, segments + 1)
    T = apply(sample_interval(count, x), panel.frame)
    inner = np.zeros((segments, *panel.frame.shape[1:]), complex)
    for group in panel.groups:
        B = panel.generator[:, group.part, group.part]
        c = np.trace(B, axis1=1, axis2=2) / group.size
        growth = half * np.diff(apply(integrate_interval(count, x), c))
        own = group_transitions(B - c[:, None, None] * np.eye(group.size), x, half)
        inner[:, group.part, group.part] = np.exp(growth)[:, None, None] * own
    return (T[1:] @ np.swapaxes(np.linalg.solve(np.swapaxes(T[:-1], 1, 2), np.swapaxes(inner, 1, 2)), 1, 2)).real


def group_transitions(B: Array, x: Array, half: float) -> Array:
    """Complex transition matrices of w' = B w between the points x of [-1, 1], B (N, p, p) at Chebyshev nodes without trace."""
    p = B.shape[-1]
    if p == 1:
        return np.ones((len(x) - 1, 1, 1))
    real = as_real(half * B)
    Phi = gauss_transitions(lambda y: apply(sample_interval(len(B), y), real), x, STAGES)
    return Phi[:, :p, :p] + 1j * Phi[:, p:, :p]


def sample_interval(count: int, x: Array) -> Array:
    """The matrix from values at the nodes to values at x in [-1, 1]."""
    return chebyshev_basis(x, count) @ chebyshev_transform(count)


def integrate_interval(count: int, x: Array) -> Array:
    """The matrix from values at the nodes to integrals from -1 to x."""
    return chebyshev_basis(x, count + 1) @ chebint(chebyshev_transform(count), lbnd=-1, axis=0)


@lru_cache(maxsize=64)
def filter_interval(count: int, kept: float) -> tuple[Array, Array]:
    """The matrices from values at the nodes to filtered values and their derivatives at the nodes."""
    filtered = chebyshev_transform(count) * (np.arange(count) < kept * count)[:, None]
    x = chebyshev_nodes(count)
    return chebyshev_basis(x, count) @ filtered, chebyshev_basis(x, count - 1) @ chebder(filtered, axis=0)
