"""The spectrum of a long product of matrices, taken from its factors: 1e-1300 and 1e+1300 come out beside each other, with their errors."""

from dataclasses import dataclass

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.lapack import find_routines
from flexlin.periodic.product.balancing import GROUP_CONDITION


def spectrum_shapes(n: int, K: int, *given: object) -> tuple[object, ...]:
    """What `find_spectrum` takes and makes."""
    p, q = given[6:8]
    return (K, n, n), (K, n, n), (n, n), (K, n, n), (K, n, p), (K, p, q), (K, q, n), n, n, n, n, (n, n), 1


ROUTINES = ("dgebal", "zgees", "zgeqrf", "zungqr", "dgesv")
"""Of LAPACK, as the compiled code takes them."""
FIND_SPECTRUM = declare(
    "int find_spectrum(int n, int count, const double *plain, const double *better, const double *start, double limit, "
    "const double *middles, double each, int p, int q, const double *left, const double *size, const double *right, "
    "const void *lapack, double complex *logs, double complex *shift, double *method, double *rounding, double *end, int *stretched)",
    spectrum_shapes,
    ("better", "start", "middles", "left", "size", "right"),
)
FIND_SCHUR = declare(
    "int find_periodic_schur(int n, int count, const double *factors, const double *start, const void *lapack, double complex *Q, "
    "double complex *T, double complex *turn, double complex *logs, double *end, double *defect)",
    lambda n, K, *_: ((K, n, n), (n, n), (K + 1, n, n), (K, n, n), n, n, (n, n), 1),
    ("start",),
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


@dataclass(frozen=True)
class PeriodicSchur:
    """F_k Q_k = Q_(k+1) T_k, k = 0 ... K - 1, with Q_K = Q_0 diag(turn) up to `defect`.

    Q (K + 1, n, n) unitary; T (K, n, n) complex, upper triangular; turn (n,) of modulus 1; logs (n,) of the product's eigenvalues;
    start (n, n) real: the last orthogonal iterate, to begin a similar product from; defect: the coupling that was dropped, relative to 1.
    """

    Q: Array
    T: Array
    turn: Array
    logs: Array
    start: Array
    defect: float


def find_spectrum(
    plain: Array,
    better: Array | None = None,
    unknown: Unknown | None = None,
    *,
    start: Array | None = None,
    middles: Array | None = None,
    each: float = 1.0,
    limit: float = GROUP_CONDITION,
) -> ProductSpectrum:
    """The eigenvalues of F_(K-1) ... F_0 with bounds on how far better factors and rounding move them.

        d log mu_i = sum_k l_(k+1),i^H dF_k r_k,i / t_k,i        l_i, r_i: left and right eigenvectors along the product

    To second order each pair i, j adds A_ij A_ji / |log mu_i - log mu_j|, A the sums of the couplings in these coordinates, but never
    more than sqrt(A_ij A_ji); equal multipliers that share an eigenvector add Elsner's bound for their block. The factors are balanced by
    one scaling, and multiplied together while no product's condition number exceeds `limit`; the whole product is not formed.

    Parameters: plain (K, n, n), the first acts first; better: the same factors by a more accurate method; each: roundings of its size that
    a factor carries; middles (K, n, n): h A in the middle of each segment, where stages may cancel: factors carry more roundings then.
    Raises: NumericalError where a factor leaves the range of numbers.
    Source: Stewart, Sun, Matrix Perturbation Theory (1990), IV.1.3, V.2; for products Benner, Mehrmann, Xu (2002).
    """
    K, n = plain.shape[:2]
    logs, shift, method, rounding = np.empty(n, complex), np.empty(n, complex), np.empty(n), np.empty(n)
    end, stretched = np.empty((n, n)), np.zeros(1, np.intc)
    p, q = (n, n) if unknown is None else unknown.size.shape[1:]
    sides = (None, None, None) if unknown is None else (unknown.left, unknown.size, unknown.right)
    lapack, made = find_routines(*ROUTINES), (logs, shift, method, rounding, end, stretched)
    given = (contiguous(plain), contiguous(better), contiguous(start), limit, contiguous(middles), each, p, q)
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


def periodic_schur(factors: Array, start: Array | None = None) -> PeriodicSchur:
    """Bring a product F_(K-1) ... F_0 of real matrices into periodic Schur form.

    Cyclic QR sweeps (orthogonal iteration on the product) until only blocks of nearly equal moduli are left; inside such a block the
    complex Schur form of its own short product gives the rest.

    Parameters: factors (K, n, n), the first acts first; start (n, n): of a similar product. Raises: NumericalError as `find_spectrum`.
    Source: Bojanczyk, Golub, Van Dooren, SPIE 1770 (1992); Watkins, SIAM Review 47 (2005).
    """
    K, n = factors.shape[:2]
    Q, T, turn, logs = (np.empty(shape, complex) for shape in ((K + 1, n, n), (K, n, n), n, n))
    end, defect, lapack = np.empty((n, n)), np.empty(1), find_routines(*ROUTINES)
    report(FIND_SCHUR(n, K, contiguous(factors), contiguous(start), lapack, Q, T, turn, logs, end, defect))
    return PeriodicSchur(Q, T, turn, logs, end, float(defect[0]))


def product_logs(factors: Array) -> Array:
    """Logs of the eigenvalues of F_(K-1) ... F_0 (n,), by falling real part, imaginary parts in (-pi, pi]."""
    return find_spectrum(factors).logs


def solve_product(factors: Array) -> tuple[Array, Array]:
    """The logs as `product_logs` gives them, and how far rounding moves each (n,)."""
    found = find_spectrum(factors)
    return found.logs, found.rounding
