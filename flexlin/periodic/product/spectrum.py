"""The spectrum of a long product of matrices, taken from its factors: 1e-1300 and 1e+1300 come out beside each other, with their errors."""

from dataclasses import dataclass

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.lapack import LAPACK, find_routines
from flexlin.periodic.precision import CUBE, MINOR, TINY

GROUP_CONDITION = 1000.0
"""Factors are multiplied together while the product's condition number stays below this: the weakest mode loses three digits."""
COHERENT = 0.25
"""The part of the rounding errors that may add up with one sign."""
ROUTINES = ("dgebal", "zgees", "zgeqrf", "zungqr", "dgesv")
"""Of LAPACK, as the compiled code takes them."""


def balance_factors(factors: Array) -> tuple[Array, Array]:
    """Return S^-1 F_k S and the diagonal of S, one scaling by powers of two that evens rows and columns of sum |F_k|."""
    n = factors.shape[-1]
    scale = LAPACK.dgebal(np.abs(factors).sum(axis=0), scale=1, permute=0)[3]
    if n == 1 or np.all(scale == 1):
        return factors, np.ones(n)
    return factors * (scale / scale[:, None]), scale


def separate_triangular(T: Array) -> tuple[Array, Array]:
    """X unit upper triangular with T X = X diag(t) + N: eigenvectors of an upper triangular matrix, N left between equal eigenvalues.

    (t_j - t_i) X_ji + sum_(j < l < i) T_jl X_li = -T_ji      for j < i
    """
    n, t = len(T), np.diagonal(T)
    upper = np.triu(np.ones((n, n), bool), 1)
    same = upper & (np.abs(t[:, None] - t) <= CUBE * np.maximum(np.abs(t[:, None]), np.abs(t)))
    free = (upper & ~same).T
    rows, columns = free[:, :, None], free[:, None, :]
    system = np.where(rows, np.where(columns, T - t[:, None, None] * np.eye(n), 0), np.eye(n))
    X = np.linalg.solve(system, np.where(free, -T.T, 0)[:, :, None])[:, :, 0].T + np.eye(n)
    return X, np.where(same, T @ X - X * t, 0)


def bound_pairs(coupling: Array, own: Array, gap: Array, shared: Array) -> Array:
    """What pairs of eigenvalues do to each other beyond first order, (n,).

    Parameters: coupling (n, n): of the perturbation in the eigenvectors' coordinates; own (n,): first-order motions, which may
    close gaps; gap (n, n): distances of the eigenvalues; shared (n, n): couplings left between equal ones.
    """
    gap = np.maximum(gap - own[:, None] - own, 0.0)
    size = pair_size(coupling)
    pairs = np.where(size > MINOR * gap, 2 * size, size**2 / np.maximum(gap, size + TINY))  # as in motion.c
    return pairs.sum(axis=1) + bound_shared(coupling, np.abs(shared))


def pair_size(coupling: Array) -> Array:
    """sqrt(A_ij A_ji) of each pair (n, n), zero on the diagonal."""
    product = coupling * coupling.T
    np.fill_diagonal(product, 0.0)
    return np.asarray(np.sqrt(product))


def bound_shared(coupling: Array, shared: Array) -> Array:
    """Elsner's bound (|N| + |E|)^(1 - 1/m) |E|^(1/m) for each block of m multipliers that N couples; zero elsewhere."""
    bound = np.zeros(len(shared))
    linked = shared + shared.T > 0
    for members in {
        tuple(np.flatnonzero(row | own).tolist())
        for row, own in zip(linked, np.eye(len(shared), dtype=bool), strict=True)
    }:
        if len(members) > 1:
            block, m = np.ix_(members, members), len(members)
            E, N = np.linalg.norm(coupling[block]), np.linalg.norm(shared[block])
            bound[list(members)] = np.maximum(bound[list(members)], (N + E) ** (1 - 1 / m) * E ** (1 / m))
    return bound


def spectrum_shapes(n: int, K: int, *given: object) -> tuple[object, ...]:
    """What `find_spectrum` takes and makes."""
    p, q = given[6:8]
    return (K, n, n), (K, n, n), (n, n), (K, n, n), (K, n, p), (K, p, q), (K, q, n), n, n, n, n, (n, n), 1


FIND_SPECTRUM = declare(
    "int find_spectrum(int n, int count, const double *plain, const double *better, const double *start, double limit, "
    "const double *steps, double each, int p, int q, const double *left, const double *size, const double *right, "
    "const void *lapack, double complex *logs, double complex *shift, double *method, double *rounding, double *end, int *stretched)",
    spectrum_shapes,
    ("better", "start", "steps", "left", "size", "right"),
)


@dataclass(frozen=True)
class Unknown:
    """What is not known over each factor, as bounds |L left| size |right R| on couplings between left vectors L and right ones R.

    size (K, p, q); left (K, n, p), right (K, q, n): the identity where they are left out.
    """

    size: Array
    left: Array | None = None
    right: Array | None = None


@dataclass(frozen=True)
class ProductSpectrum:
    """Logs of the eigenvalues (n,) by falling real part, imaginary parts in (-pi, pi], and bounds on their motion, (n,).

    shift: the first-order motion by the better factors, with its sign; method: a bound on all of it; rounding: that by rounding and by what
    is not known; start (n, n): bases to begin a similar product from; stretched: whether some factors carry more roundings than others.
    """

    logs: Array
    shift: Array
    method: Array
    rounding: Array
    start: Array
    stretched: bool


def find_spectrum(
    plain: Array,
    better: Array | None = None,
    unknown: Unknown | None = None,
    *,
    start: Array | None = None,
    steps: Array | None = None,
    each: float = 1.0,
    limit: float = GROUP_CONDITION,
) -> ProductSpectrum:
    """The eigenvalues of F_(K-1) ... F_0 with bounds on how far better factors and rounding move them.

        d log mu_i = sum_k l_(k+1),i^H dF_k r_k,i / t_k,i        l_i, r_i: left and right eigenvectors along the product

    To second order each pair i, j adds A_ij A_ji / |log mu_i - log mu_j|, A the sums of the couplings in these coordinates, but never
    more than sqrt(A_ij A_ji); equal multipliers that share an eigenvector add Elsner's bound for their block. The factors are balanced by
    one scaling, and multiplied together while no product's condition number exceeds `limit`; the whole product is not formed.

    Parameters: plain (K, n, n), the first acts first; better: the same factors by a more accurate method; each: roundings of its size that
    a factor carries; steps (K, n, n): h A at the beginning of each segment, where stages may cancel: factors carry more roundings then.
    Raises: NumericalError where a factor leaves the range of numbers.
    Source: Stewart, Sun, Matrix Perturbation Theory (1990), IV.1.3, V.2; for products Benner, Mehrmann, Xu (2002).
    """
    K, n = plain.shape[:2]
    logs, shift, method, rounding = np.empty(n, complex), np.empty(n, complex), np.empty(n), np.empty(n)
    end, stretched = np.empty((n, n)), np.zeros(1, np.intc)
    p, q = (n, n) if unknown is None else unknown.size.shape[1:]
    sides = (None, None, None) if unknown is None else (unknown.left, unknown.size, unknown.right)
    lapack, made = find_routines(*ROUTINES), (logs, shift, method, rounding, end, stretched)
    given = (contiguous(plain), contiguous(better), contiguous(start), limit, contiguous(steps), each, p, q)
    report(FIND_SPECTRUM(n, K, *given, *map(contiguous, sides), lapack, *made))
    order = np.argsort(-logs.real, kind="stable")
    return ProductSpectrum(logs[order], shift[order], method[order], rounding[order], end, bool(stretched[0]))


def contiguous(values: Array | None) -> Array | None:
    """Real numbers as compiled code takes them; none of none."""
    return None if values is None else np.ascontiguousarray(values, dtype=float)


def report(code: int) -> None:
    """Raise what a code of the compiled functions means."""
    if code == 1:
        raise MemoryError("the spectrum of a product")
    if code:
        raise NumericalError(
            "the product of the transition matrices has no spectrum in double precision",
            got="a factor that leaves the range of numbers" if code == 2 else "eigenvalues that are not found",
            todo="use more segments, or scale the states",
        )
