"""Long products of matrices, taken from their factors and never multiplied out: their spectra with errors, and periodic vectors."""

import ctypes
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import cython_lapack, lapack

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.circle import match_logs, measure_distances, wrap_log
from flexlin.precision import CUBE_ROOT_EPS, EPS, FAINT, LARGEST_LOG_GROWTH, MINOR, ROOT_EPS, SAFETY, TINY

GROUP_CONDITION = 1000.0
"""Factors are multiplied together while the product's condition number stays below this: the weakest mode loses three digits."""
COHERENT_PART = 0.25
"""The part of the rounding errors that may add up with one sign."""
ROUTINES = ("dgebal", "zgees", "dgelq2", "zgelq2", "dorgl2", "zungl2", "dgesv", "ztrexc")
"""Of LAPACK, as the compiled code takes them."""


@dataclass(frozen=True)
class Halving:
    """One halving: R x_mid = top - left x_left - right x_right, and the rows Q that make it."""

    Q: Array
    R: Array
    left: Array
    right: Array


@dataclass(frozen=True)
class CyclicSystem:
    """The condensed form of x_(k+1) - F_k x_k = g_k, x_K = x_0.

    Neighbouring rows C1 x_0 + D1 x_1 = g1, C2 x_1 + D2 x_2 = g2 are rotated by the full QR of [D1; C2]:
    the upper half gives x_1 from its neighbours, the lower half is one row between x_0 and x_2. Halving repeats until
    (C + D) x_0 = g. No product of factors is ever formed.

    Source: Wright, Stable parallel algorithms for two-point boundary value problems, SIAM J. Sci. Stat. Comput. 13 (1992).
    """

    levels: tuple[Halving, ...]
    closure: Array
    size: Array
    """Of C and D before they are added (...): what a singular value of their sum counts against."""

    def solve(self, g: Array) -> Array:
        """Return x_0 ... x_(K-1) of shape (..., K, n, r) for right sides g of the same shape."""
        n, tops = g.shape[-2], []
        for level in self.levels:
            last = 2 * level.R.shape[-3]
            rotated = level.Q @ np.concatenate([g[..., 0:last:2, :, :], g[..., 1:last:2, :, :]], axis=-2)
            tops.append(rotated[..., :n, :])
            g = np.concatenate([rotated[..., n:, :], g[..., last:, :, :]], axis=-3)
        x = np.linalg.solve(self.closure, g[..., 0, :, :])[..., None, :, :]
        for level, top in zip(self.levels[::-1], tops[::-1], strict=True):
            pairs = level.R.shape[-3]
            left, right = x[..., :pairs, :, :], np.roll(x, -1, axis=-3)[..., :pairs, :, :]
            middle = np.linalg.solve(level.R, top - (level.left @ left + level.right @ right))
            both = np.stack([left, middle], axis=-3).reshape(*middle.shape[:-3], 2 * pairs, *middle.shape[-2:])
            x = np.concatenate([both, x[..., pairs:, :, :]], axis=-3)
        return x


def cyclic_system(F: Array) -> CyclicSystem:
    """Condense x_(k+1) - F_k x_k = g_k, x_K = x_0 for factors F (..., K, n, n), real or complex."""
    C, D = -F, np.broadcast_to(np.eye(F.shape[-1], dtype=F.dtype), F.shape)
    levels, n = [], F.shape[-1]
    while (count := C.shape[-3]) > 1:  # every second unknown of the rows C_k x_k + D_k x_(k+1) is eliminated
        even, odd = slice(0, count - count % 2, 2), slice(1, None, 2)
        Q, R = np.linalg.qr(np.concatenate([D[..., even, :, :], C[..., odd, :, :]], axis=-2), mode="complete")
        Qh = np.conj(np.swapaxes(Q, -1, -2))
        left, right = Qh[..., :n] @ C[..., even, :, :], Qh[..., n:] @ D[..., odd, :, :]
        levels.append(Halving(Qh, R[..., :n, :], left[..., :n, :], right[..., :n, :]))
        C, D = (
            np.concatenate([rotated[..., n:, :], rows[..., even.stop :, :, :]], axis=-3)
            for rotated, rows in ((left, C), (right, D))
        )
    C, D = C[..., 0, :, :], D[..., 0, :, :]
    return CyclicSystem(tuple(levels), C + D, np.linalg.norm(C, axis=(-2, -1)) + np.linalg.norm(D, axis=(-2, -1)))


find_form_in_core = declare(
    "int find_form(int n, int count, const double *factors, const void *lapack, double complex *Q, double complex *T, "
    "double complex *closure, double complex *turn, double complex *logs)",
    lambda n, K, *_: ((K, n, n), (K + 1, n, n), (K, n, n), (n, n), n, n),
)
find_vectors_in_core = declare(
    "int find_vectors(int n, int count, int p, double complex *Q, double complex *T, double complex *closure, double complex *turn, "
    "double complex *logs)",
    lambda n, K, *_: ((K + 1, n, n), (K, n, n), (n, n), n, n),
)


def periodic_vectors(factors: Array, times: Array, exponents: Array) -> tuple[Array, Array, Array]:
    """p_k, q_k (K, n, n) for real factors (K, n, n) between times (K + 1,): of each exponent one, of all that there are.

        p_(k+1) = exp(-lambda h_k) F_k p_k,   p_K = p_0,   q_k^H p_k = 1
        F_k Q_k = Q_(k+1) T_k,   p_k = Q_k X_k c_k,   q_k = (Q_k X_k)^-H / conj(c_k),   log c_(k+1) = log c_k + log t_k - lambda h_k

    Q, T: the periodic Schur form, t its diagonal; X: unit upper triangular, carried backwards through the period, on which what decays
    faster loses weight. The largest entry of each p is 1. Each mode is the one whose own log is nearest to the exponent.
    Returns: p, q, and whether the factors know such vectors (n,): not where a mode is too fast for them, or spans more than doubles hold.
    """
    (K, n), (factors, scale), steps = factors.shape[:2], balance_factors(factors), np.diff(times)
    period = times[-1] - times[0]
    right, left = np.empty((K + 1, n, n), complex), np.empty((K, n, n), complex)
    closure, turn, logs = np.empty((n, n), complex), np.empty(n, complex), np.empty(n, complex)
    form = right, left, closure, turn, logs
    if code := find_form_in_core(n, K, contiguous(factors), find_routines(), *form):
        raise report_lost_product(code)
    growth = np.log(np.diagonal(left, axis1=1, axis2=2))
    column, apart = match_logs(exponents * period, logs)
    known = apart < CUBE_ROOT_EPS * np.maximum(1.0, np.abs(logs[column]))
    parted = max(1, 1 + int(column[known].max(initial=0)))
    known &= not find_vectors_in_core(n, K, parted, *form)
    right, left, growth = right[:-1, :, column], left[:, :, column], growth[:, column] - exponents * steps[:, None]
    run = np.append(np.zeros((1, n)), growth.cumsum(axis=0), axis=0)
    run -= wrap_log(run[-1] + np.log(turn[column])) * ((times - times[0]) / period)[:, None]
    known &= np.ptp(run.real, axis=0) < LARGEST_LOG_GROWTH
    run = np.where(known, run[:-1] - run.real.max(axis=0), 0)[:, None]
    right *= scale[:, None] * np.exp(run)
    largest = np.take_along_axis(right.reshape(-1, n), np.abs(right).reshape(-1, n).argmax(axis=0)[None], axis=0)
    right /= largest
    left *= np.exp(-run.conj()) / scale[:, None] * largest.conj()
    half_turns = np.round(exponents.imag * period / np.pi) * np.pi / period
    make_real(right, left, logs[column], np.exp(1j * half_turns * times[:-1, None]))
    return right, left, known


def make_real(right: Array, left: Array, logs: Array, turns: Array) -> None:
    """Take, of real multipliers that coincide, vectors that are real times turns (K, n), in place: any in their span are theirs."""
    near = measure_distances(logs, logs) + np.abs(np.sin(logs.imag))
    for members in {tuple(np.flatnonzero(row).tolist()) for row in near < FAINT if row.sum() > 1}:
        part = list(members)
        turn = turns[:, None, part]
        turned, dual = right[:, :, part] * turn, left[:, :, part] * turn
        both = np.concatenate([turned.real, turned.imag], axis=-1)
        _, sizes, rows = np.linalg.svd(both.reshape(-1, 2 * len(part)), full_matrices=False)
        if sizes[len(part) - 1] < ROOT_EPS * sizes[0]:  # of a chain there are fewer than multipliers
            continue
        found = both @ rows[: len(part)].T
        found /= np.abs(found).max(axis=(0, 1))
        gram = np.einsum("tki,tkj->ij", dual.conj(), found) / len(left)
        right[:, :, part], left[:, :, part] = found / turn, dual @ np.linalg.inv(gram).conj().T / turn


def balance_factors(factors: Array) -> tuple[Array, Array]:
    """Return S^-1 F_k S and the diagonal of S, one scaling by powers of two that evens rows and columns of sum |F_k|."""
    n = factors.shape[-1]
    scale = lapack.dgebal(np.abs(factors).sum(axis=0), scale=1, permute=0)[3]
    if n == 1 or np.all(scale == 1):
        return factors, np.ones(n)
    return factors * (scale / scale[:, None]), scale


def separate_triangular(T: Array) -> tuple[Array, Array]:
    """X unit upper triangular with T X = X (diag(t) + N): eigenvectors of an upper triangular matrix, N left between equal eigenvalues.

    (t_j - t_i) X_ji + sum_(j < l < i) T_jl X_li = -T_ji      for j < i, and again for what N leaves of X^-1 T X elsewhere

    Equal are eigenvalues that differ by little of themselves, or by no more than the rounding of T.
    """
    n, t, X = len(T), np.diagonal(T), np.eye(len(T))
    upper, least = np.triu(np.ones((n, n), bool), 1), SAFETY * EPS * np.abs(T).max(initial=0.0)
    same = upper & (np.abs(t[:, None] - t) <= CUBE_ROOT_EPS * np.maximum(np.abs(t[:, None]), np.abs(t)) + least)
    free = (upper & ~same).T
    rows, columns = free[:, :, None], free[:, None, :]
    for _ in range(n if same.any() else 1):
        system = np.where(rows, np.where(columns, T - t[:, None, None] * np.eye(n), 0), np.eye(n))
        step = np.linalg.solve(system, np.where(free, -T.T, 0)[:, :, None])[:, :, 0].T + np.eye(n)
        T, X = np.triu(np.linalg.solve(step, T @ step)), X @ step
    return X, np.where(same, T, 0)


def bound_pairs(coupling: Array, own: Array, gap: Array, shared: Array) -> Array:
    """What pairs of eigenvalues do to each other beyond first order, (n,).

    Parameters: coupling (n, n): of the perturbation in the eigenvectors' coordinates; own (n,): first-order motions, which may
    close gaps; gap (n, n): distances of the eigenvalues; shared (n, n): couplings left between equal ones.
    """
    gap = np.maximum(gap - own[:, None] - own, 0.0)
    size = np.where(np.eye(len(coupling), dtype=bool), 0.0, np.sqrt(coupling * coupling.T))
    pairs = np.where(size > MINOR * gap, 2 * size, size**2 / np.maximum(gap, size + TINY))  # as in motion.c
    return pairs.sum(axis=1) + bound_shared(coupling, np.abs(shared))


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


def complex_schur(A: Array) -> tuple[Array, Array]:
    """T upper triangular and Z unitary (n, n) with A = Z T Z^H, by zgees without SciPy's checks, which take longer than a small one.

    Raises: ValueError where A is not finite; LinAlgError where the eigenvalues are not found.
    """
    T, _, _, Z, _, failed = lapack.zgees(lambda value: False, np.asarray_chkfinite(A, complex), lwork=64 * len(A))
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of a Schur form are not found")
    return T, Z


@cache
def find_routines() -> "ctypes.Array[ctypes.c_void_p]":
    """Where the routines of LAPACK stand, for compiled code that calls them with 32-bit integers."""
    api, capsules = ctypes.pythonapi, [cython_lapack.__pyx_capi__[name] for name in ROUTINES]
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    places = [api.PyCapsule_GetPointer(one, api.PyCapsule_GetName(one)) for one in capsules]
    return (ctypes.c_void_p * len(ROUTINES))(*places)


find_spectrum_in_core = declare(
    "int find_spectrum(int n, int count, const double *plain, const double *better, const double *start, double limit, "
    "const double *steps, int p, int q, int part, const double *left, const double *size, const double *right, "
    "const void *lapack, double complex *logs, double complex *shift, double *method, double *rounding, double *end, int *stretched)",
    lambda n, K, plain, better, start, limit, steps, p, q, *_: (
        *((K, n, n), (K, n, n), (n, n), (K, n, n), (K, n, p), (K, p, q), (K, q, n), n, n, n, n, (n, n), 1),
    ),
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
    is not known, inf of modes that only lie below the others; start (n, n): bases to begin a similar product from; stretched: whether some
    factors carry more roundings than others.
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
    limit: float = GROUP_CONDITION,
    part: bool = False,
) -> ProductSpectrum:
    """The eigenvalues of F_(K-1) ... F_0 with bounds on how far better factors and rounding move them.

        d log mu_i = sum_k l_(k+1),i^H dF_k r_k,i / t_k,i        l_i, r_i: left and right eigenvectors along the product

    To second order each pair i, j adds A_ij A_ji / |log mu_i - log mu_j|, A the sums of the couplings in these coordinates, but never
    more than sqrt(A_ij A_ji); equal multipliers that share an eigenvector add Elsner's bound for their block. The factors are balanced by
    one scaling, and multiplied together while no product's condition number exceeds `limit`; the whole product is not formed.

    Parameters: plain (K, n, n), the first acts first; better: the same factors by a more accurate method; steps (K, n, n): h A at
    the beginning of each segment, where stages may cancel: factors carry more than one rounding of their size then; part: where rounding
    leaves nothing of some modes, ask of them and of those below no more than that they lie below the others.
    Raises: NumericalError where a factor leaves the range of numbers.
    Source: Stewart, Sun, Matrix Perturbation Theory (1990), IV.1.3, V.2; for products Benner, Mehrmann, Xu (2002).
    """
    K, n = plain.shape[:2]
    logs, shift, method, rounding = np.empty(n, complex), np.empty(n, complex), np.empty(n), np.empty(n)
    end, stretched = np.empty((n, n)), np.zeros(1, np.intc)
    p, q = (n, n) if unknown is None else unknown.size.shape[1:]
    sides = (None, None, None) if unknown is None else (unknown.left, unknown.size, unknown.right)
    routines, made = find_routines(), (logs, shift, method, rounding, end, stretched)
    given = (contiguous(plain), contiguous(better), contiguous(start), limit, contiguous(steps), p, q, part)
    code = find_spectrum_in_core(n, K, *given, *map(contiguous, sides), routines, *made)
    if code:
        raise report_lost_product(code)
    order = np.argsort(-logs.real, kind="stable")
    return ProductSpectrum(logs[order], shift[order], method[order], rounding[order], end, bool(stretched[0]))


def report_lost_product(code: int) -> NumericalError:
    """The error of factors whose product has no Schur form."""
    return NumericalError(
        "the product of the transition matrices has no spectrum in double precision",
        got="a factor that leaves the range of numbers" if code == 1 else "eigenvalues that are not found",
        todo="use more segments, or scale the states",
    )


def contiguous(values: Array | None) -> Array | None:
    """Real numbers as compiled code takes them; none of none."""
    return None if values is None else np.ascontiguousarray(values, dtype=float)
