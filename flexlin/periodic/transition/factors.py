"""Transition matrices of the segments of a period by collocation, from resolved coefficients: compiled, several segments at a time."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from scipy.linalg import lapack

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.errors import SingularMassMatrix
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix
from flexlin.periodic.coefficients import MatrixFunction, solve_mass, stack_companion
from flexlin.periodic.product import Unknown
from flexlin.periodic.transition.gauss import (
    CHUNK_BYTES,
    DEFAULT_STAGES,
    Tableau,
    collocate,
    fold_samples,
    gauss,
    place_nodes,
)
from flexlin.precision import EPS

Resolved = ResolvedMatrix | ResolvedCompanion
MOST_UNKNOWNS = 300
"""Stages times states up to which the compiled code serves; LAPACK is faster beyond."""


factor_states_in_core = declare(
    "int factor_states(int n, int stages, int segments, int stiff, const double *A, const double *lengths, const double *tableau, "
    "const double *units, double *Phi, int *good)",
    lambda n, s, K, *_: ((K, s, n, n), (K,), s * (s + 1), (n,), (K, n, n), (K,)),
)
factor_accelerations_in_core = declare(
    "int factor_accelerations(int m, int stages, int segments, const double *blocks, const double *lengths, const double *tableau, "
    "double *kept, double *by_start, double *Phi, int *good)",
    lambda m, s, K, *_: (
        *((K, s, m, 3 * m), (K,), 2 * s * (s + 1)),
        *(kept_numbers(m, s, K), (K, s * m, 2 * m), (K, 2 * m, 2 * m), (K,)),
    ),
    optional=("kept", "by_start"),
)


def kept_numbers(m: int, stages: int, segments: int) -> int:
    """How many numbers `factor_accelerations` keeps at the most: equations and factors of up to eight segments at a time."""
    n = stages * m
    return (segments + 7) * (2 * n * n + m + 1) + 8


def factor_segments(sample: MatrixFunction, edges: Array, rule: Tableau) -> Array:
    """Transition matrices (..., K, n, n) over the segments between consecutive edges (..., K + 1), from A(t) or [M D K](t).

    Raises: SingularMassMatrix, MemoryError; NumericalError where the stages of a segment are not determined.
    """
    h, some = np.diff(edges), sample_segments(sample, sample(edges.ravel()[:1]).shape[1:], edges, (rule,))
    steps = np.concatenate([factor(staged, h.ravel()[part], rule) for part, (staged,), _ in some])
    return steps.reshape(*h.shape, *steps.shape[1:])


def measure_segments(
    resolved: Resolved, edges: Array, rules: tuple[Tableau, Tableau]
) -> tuple[list[Array], Array, Unknown]:
    """Transition matrices (K, n, n) by each of two rules; h A at the beginning of each segment (K, n, n); what is not known over it.

    Unknown are roundings of the coefficients and the error of their series. Of a second-order system with vectors [y; v]:

        left M^-1 (dM z + dD v + dK y),   z = M^-1 (K y + D v)

    Raises: as `factor_segments`.
    """
    h, second = np.diff(edges), isinstance(resolved, ResolvedCompanion)
    K, (m, columns), error = len(h), resolved.shape, resolved.mean_error(edges)
    n = 2 * m if second else m
    plain, better, hA = np.empty((3, K, n, n))
    size, sides = np.empty((K, m, columns)), list[Array]()
    if second:
        sides = [np.zeros((K, n, m)), np.zeros((K, columns, n))]
    for part, staged, starts in sample_segments(resolved.series, resolved.shape, edges, rules, True):
        lengths = h[part, None, None]
        size[part] = lengths * (EPS * np.abs(starts) + error[part])
        for made, values, rule in zip((plain, better), staged, rules, strict=True):
            made[part] = factor(values, h[part], rule)
        if not isinstance(resolved, ResolvedCompanion):
            hA[part] = lengths * starts
            continue
        M, D, S = resolved.split(starts)
        eye = np.broadcast_to(np.eye(m), M.shape)
        inverse, X, Y = np.split(solve_mass(M, np.concatenate([eye, -S, -D], axis=2), edges[:-1][part]), 3, axis=2)
        hA[part] = lengths * stack_companion(X, Y)
        left, right = sides
        left[part, m:] = inverse
        right[part, :m, :m], right[part, :m, m:] = -X, -Y
        right[part, m : 2 * m, m:] = right[part, 2 * m :, :m] = eye
    return [plain, better], hA, Unknown(size, *sides)


def sample_segments(
    sample: MatrixFunction, shape: tuple[int, ...], edges: Array, rules: tuple[Tableau, ...], starts: bool = False
) -> Iterator[tuple[slice, list[Array], Array]]:
    """The coefficients, A or [M D K], of as many segments at a time as have equations of CHUNK_BYTES: which, at the stages of each rule
    (k, s, rows, columns), and at their beginnings (k, rows, columns) where asked for.

    A stage at the end of a segment stands just before it, so jumps there do no harm."""
    nodes = [rule.c for rule in rules] + [np.zeros(1)] * starts
    size = max(8, CHUNK_BYTES // (8 * (shape[0] * max(map(len, nodes))) ** 2))
    places = [place_nodes(edges, c).reshape(-1, len(c)) for c in nodes]
    for i in range(0, len(places[0]), size):
        times = [place[i : i + size] for place in places]
        t = np.concatenate([part.ravel() for part in times])
        sampled = np.ascontiguousarray(fold_samples(sample(t), t), dtype=float)
        values = np.split(sampled, np.cumsum([part.size for part in times])[:-1])
        split = [part.reshape(len(times[0]), -1, *shape) for part in values]
        yield slice(i, i + size), split[: len(rules)], split[-1][:, 0]


def factor(values: Array, h: Array, rule: Tableau) -> Array:
    """Transition matrices (K, n, n) from A or [M D K] at the stages (K, s, rows, columns) and lengths h (K,)."""
    rows, columns = values.shape[-2:]
    return (factor_accelerations if columns == 3 * rows else factor_states)(values, h, rule)


def factor_accelerations(blocks: Array, h: Array, rule: Tableau) -> Array:
    """From [M D K], with the accelerations as unknowns; what needs rows exchanged is left to A. Raises: SingularMassMatrix."""
    K, s, m = blocks.shape[:3]
    Phi, good = np.empty((K, 2 * m, 2 * m)), np.zeros(K, np.intc)
    factor_accelerations_in_core(m, s, K, blocks, h, tabulate(rule, True), None, None, Phi, good)
    lost = np.flatnonzero(good == 0)
    if len(lost):
        M, damped = np.split(blocks[lost], [m], axis=-1)
        try:
            Y, X = np.split(-np.linalg.solve(M, damped), 2, axis=-1)
        except np.linalg.LinAlgError:
            raise SingularMassMatrix(
                "the mass matrix is singular on some segment of the period",
                todo="give every coordinate inertia, or remove the coordinate",
            ) from None
        Phi[lost] = factor_states(stack_companion(X, Y), h[lost], rule)
    return Phi


def factor_states(A: Array, h: Array, rule: Tableau) -> Array:
    """From A, in units in which its rows and columns are of like size, as a solution of linear equations needs them to keep its digits.

    Raises: NumericalError. Source: Parlett, Reinsch, Balancing a matrix, Numer. Math. 13 (1969), on the sum of |A|.
    """
    K, s, n = A.shape[:3]
    units = np.asarray(lapack.dgebal(np.abs(A).sum(axis=(0, 1)), scale=1, permute=0)[3])
    Phi, good = np.empty((K, n, n)), np.zeros(K, np.intc)
    stiff = int(rule.c[-1] == 1.0)
    if s * n <= MOST_UNKNOWNS:
        factor_states_in_core(n, s, K, stiff, A, h, tabulate(rule, False), units, Phi, good)
    lost = np.flatnonzero(good == 0)
    if len(lost):
        turn = units / units[:, None]
        Phi[lost] = collocate(A[lost] * turn, h[lost], rule) / turn
    return Phi


def gauss_transitions(A: MatrixFunction, edges: Array, stages: int = DEFAULT_STAGES) -> Array:
    """Transition matrices of x' = A(t) x over the segments between consecutive edges.

        Y_i = I + h sum_j a_ij A_j Y_j,   Phi = I + h sum_j b_j A_j Y_j

    Assumes A smooth inside each segment. The error is O(h^(2 stages)); quadratic invariants (a symplectic form) are kept.

    Parameters: A: function (N,) -> (N, n, n); edges: increasing times (..., K + 1); stages >= 1.
    Returns: Phi (..., K, n, n), x(edges[k + 1]) = Phi[k] x(edges[k]).
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, II.1, IV.2.
    """
    return factor_segments(A, edges, gauss(stages))


@lru_cache(maxsize=64)
def tabulate(rule: Tableau, second_order: bool) -> Array:
    """A rule in one row, as compiled code takes it: a, b; or c, a, a a, b."""
    parts = (rule.c, rule.a, rule.a @ rule.a, rule.b) if second_order else (rule.a, rule.b)
    return np.concatenate([part.ravel() for part in parts])
