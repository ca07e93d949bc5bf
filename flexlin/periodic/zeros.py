"""Invariant zeros: the motions that a system may make while its output stays zero."""

from functools import partial
from operator import itemgetter

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive
from flexlin.errors import ArgumentError, NumericalError, counted
from flexlin.periodic.circle import assign
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix, couple_uncertainty
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficient_series.sampling import RESOLVED_TOL, stratified
from flexlin.periodic.coefficients import MatrixFunction, close_loop, combine
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.related import PeriodicStateSpace
from flexlin.periodic.system import PeriodicSystem, edges_between
from flexlin.precision import EPS, FAINT, SAFETY, SLIGHT, TINY
from flexlin.summary import immutable


@immutable(eq=False)
class InvariantZeros:
    """The zeros of x' = A x + B u, y = C x + D u, as exponents.

    Attributes
    ----------
    exponents : complex array, shape (n - sum of the relative degrees,)
        In 1/s, by falling real part; imaginary parts in (-pi/T, pi/T].
    errors : array
        Bounds on the error of each, in 1/s.
    relative_degree : tuple of int
        How often each output is differentiated until the input appears in it.
    verdict : str
        "minimum phase" where all decay, "non-minimum phase" where one grows, else "undecided".
    status : str
        From how fast a zero on it would have been missed.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-2.0, -3.0]], 1.0, B=[[0.0], [1.0]])
    >>> found = fl.invariant_zeros(system, [[-1.0, 1.0]])
    >>> print(f"{found.exponents.real.item():.6f} {found.verdict}")
    1.000000 non-minimum phase
    """

    exponents: Array
    errors: Array
    relative_degree: tuple[int, ...]
    verdict: str
    status: str


@checked
def invariant_zeros(
    system: PeriodicSystem,
    C: MatrixFunction | ArrayLike,
    D: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> InvariantZeros:
    """Find the invariant zeros of a periodic system with as many inputs as outputs.

        h_0 = C_i,   h_(j+1) = h_j' + h_j A,   y_i^(k) = h_k x + h_(k-1) B u   with the least k where the last term is not zero

    u = -E^-1 [h_k x + ...], E the matrix of the rows h_(k-1) B, gives each output poles that are chosen; the other exponents of this loop
    are those of the motions along which the output stays zero. Assumes that E is invertible at all times. A last term counts as zero below
    4e-11 of what it is summed from, where rounding may make it: a zero that lies as much farther out than the system's rates is missed,
    of which the verdict says nothing, and the status gives the rate.

    Parameters
    ----------
    system : PeriodicSystem
        With inputs; n states, m inputs.
    C : array_like (m, n), or function of times (N,) -> (N, m, n)
        The output matrix.
    D : array_like (m, m), or function of times (N,) -> (N, m, m), optional
        The feedthrough; zero where it is not given.
    tol : float
        Wanted error of the exponents, in 1/s.

    Returns
    -------
    InvariantZeros
        Exponents with errors, relative degrees, verdict.

    Raises
    ------
    ArgumentError
        When the system has no input, or a matrix does not fit.
    NumericalError
        When the input does not reach an output, or reaches it in another derivative at other times.

    References
    ----------
    Isidori, Nonlinear Control Systems (1995), section 5.1 (vector relative degree, zero dynamics); Bittanti, Colaneri, Periodic Systems
    (2009), section 5.6.

    Examples
    --------
    Bittanti and Colaneri's example 1.2 has the zero 4 / sqrt(3) - 3, the mean of (3 sin t - 2) / (2 - sin t):

    >>> import numpy as np
    >>> import flexlin as fl
    >>> def A(t):
    ...     c, s, none = np.cos(t), np.sin(t), np.zeros_like(t)
    ...     return np.array([[s - 1, none], [1 - c, none - 3]]).transpose(2, 0, 1)
    >>> def B(t):
    ...     return np.array([[-1 - np.cos(t)], [2 - np.sin(t)]]).transpose(2, 0, 1)
    >>> found = fl.invariant_zeros(fl.PeriodicSystem(A, 2 * np.pi, B), [[0.0, 1.0]])
    >>> print(f"{found.exponents.real.item():.9f} {4 / 3**0.5 - 3:.9f}")
    -0.690598923 -0.690598923
    """
    plant, tol = PeriodicStateSpace(system, C, D), positive("tol", tol)
    system, n = plant.system, plant.system.n
    if plant.p != system.m:
        raise ArgumentError("C does not fit the system", got=plant.p, expected=f"{system.m}: as many outputs as inputs")
    A, B, *ports = plant.series
    chains, faint = find_chains(system, *ports)
    degrees = tuple(len(rows) - 1 for rows, _ in chains)
    poles = 2 * np.pi / system.period * (0.5 + 0.23 * np.arange(sum(degrees)))
    weights = (np.atleast_1d(np.poly(-own))[::-1] for own in np.split(poles, np.cumsum(degrees)[:-1]))
    decay = combine(
        gather_rows, *(combine(partial(weigh, w), *rows) for w, (rows, _) in zip(weights, chains, strict=True))
    )
    E = combine(gather_rows, *(by_input for _, by_input in chains))
    check_degrees(E, system.period)
    edges = edges_between(A, B, *(row for rows, _ in chains for row in rows))
    loop = combine(close_loop, A, B, combine(np.linalg.solve, E, decay))
    found = floquet(PeriodicSystem(loop, system.period, breaks=edges, complete=True), tol)
    apart = np.abs(found.exponents[:, None] + poles)
    kept = np.setdiff1d(np.arange(n), assign(apart.T)) if len(poles) else np.arange(n)
    t = system.period * stratified(64)
    by_row, unknown = np.abs(B(t) @ np.linalg.inv(E(t))), np.concatenate([rows[-1].error for rows, _ in chains])
    exponents = found.exponents[kept]
    errors = found.errors[kept] + float(np.linalg.norm(by_row @ unknown, 2, axis=(1, 2)).max())
    real = exponents.real
    grows, decays = np.any(real > errors), np.all(real < -errors)
    verdict = "non-minimum phase" if grows else "minimum phase" if decays else "undecided"
    return InvariantZeros(exponents, errors, degrees, verdict, describe_missed(faint, float(np.abs(A(t)).max())))


def describe_missed(faint: float, rate: float) -> str:
    """What was left out: the input's largest action that counted as none, as a share of what it is summed from."""
    if not faint:
        return "no action of the input was left out"
    return (
        f"action of the input that is {faint:.1g} of its terms counts as rounding; were it real, a zero near {rate / faint:.1g} 1/s, "
        "growing or not, would be missed: leave out states as fast as that, or bring units to like sizes"
    )


Chain = tuple[list[ResolvedMatrix], MatrixFunction]
"""One output and its derivatives, h_0 ... h_k, each (1, n), k its relative degree, and the row by which u acts on the last."""


def weigh(weights: Array, *rows: Array) -> Array:
    """A sum of rows, each by its weight."""
    return np.asarray(sum(weight * row for weight, row in zip(weights, rows, strict=True)))


def gather_rows(*rows: Array) -> Array:
    """Rows (N, 1, n) one above the other."""
    return np.concatenate(rows, axis=1)


def differentiate(row: ResolvedMatrix, A: MatrixFunction) -> MatrixFunction:
    """h' + h A."""
    slope = row.derivative()
    return lambda t: slope(t) + row(t) @ A(t)


def find_chains(system: PeriodicSystem, C: ResolvedMatrix, D: ResolvedMatrix) -> tuple[list[Chain], float]:
    """Each output's derivatives until the input appears, and the largest share of its terms by which it did not yet.

    Raises: NumericalError where it never does, or a derivative jumps before.
    """
    faint = 0.0
    t, A, B, chains = system.period * stratified(4 * SAMPLES), system.resolved, system.resolved_input, list[Chain]()
    A_at, B_at, every = np.abs(A(t)), np.abs(B(t)), np.eye(system.n)
    for i in range(system.m):
        of_output = itemgetter((slice(None), slice(i, i + 1)))
        row = take(system, combine(of_output, C), C.breaks)
        rows, by_input, unknown = [row], combine(of_output, D), row.error
        size = np.abs(D(t)).max()
        while not (acts := float(np.abs(by_input(t)).max())) > FAINT * size:
            faint = max(faint, acts / (size or 1.0))
            if len(rows) > system.n:
                raise NumericalError(
                    f"the input does not reach output {i + 1}", expected="an output that the input moves"
                )
            if jumps(row):
                raise NumericalError(
                    f"a derivative of output {i + 1} jumps before the input acts on it",
                    got=counted(len(rows) - 1, "derivative"),
                    todo="smooth the coefficients",
                )
            by_input, row_at, slope = combine(np.matmul, row, B), np.abs(row(t)), row.derivative()
            # where entries of a row and of B vanish by turns, their product is what is not known of them
            size = float((row_at @ B_at + (unknown @ B_at + row_at @ B.error) / FAINT).max()) + TINY
            unknown = unknown * row.series.rate + (unknown @ A_at + couple_uncertainty(A, t, row(t), every)).max(axis=0)
            row = take(system, differentiate(row, A), row.breaks, (np.abs(slope(t)) + row_at @ A_at).max(axis=0))
            unknown = unknown + row.error
            rows.append(row)
        chains.append((rows, by_input))
    return chains, faint


def take(
    system: PeriodicSystem, function: MatrixFunction, breaks: tuple[float, ...], summed: Array | float = 0.0
) -> ResolvedMatrix:
    """What is made of series, as a series: smooth between the edges of their panels, which shall not chase a derivative's rounding.

    summed: sizes of what each entry is summed from, which may cancel.
    """
    corners, tol = sorted({*breaks, *edges_between(system.resolved, system.resolved_input)}), 100 * RESOLVED_TOL
    return resolve(function, system.period, corners, complete=True, tol=tol, least=tol / EPS * summed)


def jumps(row: ResolvedMatrix) -> bool:
    """Whether a row is not the same on both sides of an edge."""
    edges = row.edges[:-1]
    apart = np.abs(row(edges) - row(edges, left=True)).max(axis=0)
    return bool(np.any(apart > SAFETY * row.error + FAINT * np.abs(row(edges)).max()))


def check_degrees(E: MatrixFunction, period: float) -> None:
    """Raises: NumericalError where E, the matrix of the rows by which u acts, is singular at some time."""
    t = period * stratified(4 * SAMPLES)
    scaled = E(t)
    scaled = scaled / (np.abs(scaled).max(axis=(0, 2)) + TINY)[:, None]
    scaled = scaled / (np.abs(scaled).max(axis=(0, 1)) + TINY)
    sizes = np.linalg.svd(scaled, compute_uv=False)
    k = int(np.argmin(sizes[:, -1]))
    signs = np.sign(np.linalg.det(scaled))
    if sizes[k, -1] < SLIGHT * sizes.max() or np.any(signs != signs[0]):
        raise NumericalError(
            "the input does not act on the outputs in the same derivatives at all times",
            got=f"a matrix E whose smallest singular value at t = {t[k]:.4g} s is {sizes[k, -1]:.1g} of the largest",
            expected="outputs and inputs of a uniform relative degree",
        )
