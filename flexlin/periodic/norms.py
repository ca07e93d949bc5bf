"""Norms of a periodic system: H2 by its periodic Lyapunov equation, H-infinity by levels at which multipliers leave the unit circle."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive
from flexlin.errors import NotStable, ToleranceNotReached
from flexlin.periodic.circle import wrap_angle
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.coefficient_series.panels import MOST_PANELS
from flexlin.periodic.coefficient_series.resolve import resolve_constant
from flexlin.periodic.coefficients import MatrixFunction, combine
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.interpolation import NODES, divide_segments, fourier_nodes
from flexlin.periodic.levels import BoundedReal, PeakSearch
from flexlin.periodic.riccati.linear_quadratic import RiccatiSolution
from flexlin.periodic.riccati.riccati import periodic_lyapunov
from flexlin.periodic.roots import MOST_STEPS
from flexlin.periodic.system import PeriodicSystem, as_port, as_system, input_of, resolve_beside
from flexlin.precision import EPS, MINOR, SAFETY, SLIGHT, TINY
from flexlin.summary import represent


@dataclass(frozen=True)
class H2Norm:
    """The H2 norm and a bound on its error, in units of the output per root of the unit of white noise on the inputs.

    Attributes
    ----------
    value : float
        The norm.
    error : float
        Of the value.

    Examples
    --------
    >>> import flexlin as fl
    >>> print(f"{fl.h2_norm(fl.PeriodicSystem([[-2.0]], 1.0, B=[[1.0]]), [[1.0]]).value:.6f}")
    0.500000
    """

    value: float
    error: float

    __repr__ = represent


@checked
def h2_norm(system: PeriodicSystem, C: MatrixFunction | ArrayLike, tol: float = 1e-10) -> H2Norm:
    """Compute the H2 norm of x' = A x + B u, y = C x.

        |G|^2 = (1/T) int_0^T trace(B' X B) dt,   -X' = A' X + X A + C' C

    the mean power of y under white noise of unit intensity on every input. Assumes a stable system without feedthrough.

    Parameters
    ----------
    system : PeriodicSystem
        With inputs; n states, m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        The output matrix.
    tol : float
        Wanted accuracy of X, relative to its largest entry.

    Returns
    -------
    H2Norm
        value and error.

    Raises
    ------
    ArgumentError
        When the system has no input or C does not fit.
    NotStable
        When the system is not stable.
    ToleranceNotReached
        When X misses tol by far.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), section 9.1.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.5]], 1.0, B=[[0.0], [1.0]])
    >>> print(f"{fl.h2_norm(system, [[1.0, 0.0]]).value:.6f}")
    1.000000
    """
    system = as_system(system)
    B, output = system.resolved_input, as_port("C", C, (None, system.n), system.period)
    solution = periodic_lyapunov(system, combine(multiply_transposed, output), MINOR * positive("tol", tol))
    square, quadrature = mean_power(solution, B)
    t = fourier_nodes(SAMPLES, system.period)
    X, reached = np.abs(solution.X(t)), np.abs(B(t)).sum(axis=1)
    doubt = solution.error * float(X.max()) * float((reached**2).sum(axis=1).mean()) + quadrature
    value = float(np.sqrt(max(square, 0.0)))
    return H2Norm(value, float(doubt / (2 * value) if value**2 > doubt else np.sqrt(abs(square) + doubt)))


def multiply_transposed(C: Array) -> Array:
    """C' C."""
    return np.swapaxes(C, 1, 2) @ C


def mean_power(solution: RiccatiSolution, B: ResolvedMatrix) -> tuple[float, float]:
    """The mean of trace(B' X B) and what is lost in it."""

    def power(t: Array) -> Array:
        reached = B(t)
        return np.einsum("tki,tkl,tli->t", reached, solution.X(t), reached)

    return mean_of_parts(power, np.union1d(solution.edges, B.edges))


def mean_of_parts(f: Callable[[Array], Array], edges: Array) -> tuple[float, float]:
    """The mean of f over the period, panels halved until it stands still, and its last change."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    last, change = np.inf, np.inf
    while True:
        h = np.diff(edges)[:, None]
        mean = float(f((edges[:-1, None] + h * (x + 1) / 2).ravel()) @ (h * w / 2).ravel()) / float(edges[-1])
        change, before, last = abs(mean - last), change, mean
        if change > before or change <= EPS * abs(last) or len(h) > MOST_PANELS:
            return mean, change + NODES * EPS * abs(last)
        edges = divide_segments(edges, 2)


@dataclass(frozen=True)
class HinfNorm:
    """The largest gain from inputs to outputs, in the sense of energy, with its error and the frequency where it is reached.

    Attributes
    ----------
    value : float
        In units of the output per unit of the input.
    error : float
        Of the value.
    frequency : float
        In rad/s, in [0, pi/T]: the worst input is exp(i frequency t) times a periodic function.

    Examples
    --------
    >>> import flexlin as fl
    >>> norm = fl.hinf_norm(fl.PeriodicSystem([[-2.0]], 1.0, B=[[1.0]]), [[1.0]])
    >>> print(f"{norm.value:.6f} {norm.frequency:.3f}")
    0.500000 0.000
    """

    value: float
    error: float
    frequency: float

    __repr__ = represent


@checked
def hinf_norm(
    system: PeriodicSystem,
    C: MatrixFunction | ArrayLike,
    D: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> HinfNorm:
    """Compute the H-infinity norm of x' = A x + B u, y = C x + D u: the largest |y| / |u| in mean square.

    The norm lies between two levels: above, the Hamiltonian system has no multiplier on the unit circle, whose product is never
    formed; below, one lies there. They are tried beside the largest gain at single frequencies. The error is half of their distance.
    Assumes a stable system.

    Parameters
    ----------
    system : PeriodicSystem
        With inputs; n states, m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        The output matrix.
    D : array_like (p, m), or function of times (N,) -> (N, p, m), optional
        The feedthrough; zero where it is not given.
    tol : float
        Wanted relative error.

    Returns
    -------
    HinfNorm
        value, error, frequency.

    Raises
    ------
    ArgumentError
        When the system has no input, or a matrix does not fit.
    NotStable
        When the system is not stable: then the norm is infinite.
    ToleranceNotReached
        When no level brackets the norm.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), section 9.2 (periodic bounded real lemma); Boyd, Balakrishnan, Kabamba, A bisection
    method for computing the H-infinity norm, Math. Control Signals Systems 2 (1989) 207.

    Examples
    --------
    A resonance of damping ratio 0.1 amplifies by 1 / (2 z sqrt(1 - z^2)):

    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.2]], 1.0, B=[[0.0], [1.0]])
    >>> print(f"{fl.hinf_norm(system, [[1.0, 0.0]]).value:.6f} {1 / (0.2 * 0.99**0.5):.6f}")
    5.025189 5.025189
    """
    system = as_system(system)
    input_of(system)
    output, tol = as_port("C", C, (None, system.n), system.period), positive("tol", tol)
    rows = output(np.zeros(1)).shape[1]
    through = as_port("D", np.zeros((rows, system.m)) if D is None else D, (rows, system.m), system.period)
    verdict = floquet(system)
    if verdict.verdict != "stable":
        raise NotStable("the norm is infinite or unknown", got=verdict.status, expected="a stable system")
    problem = BoundedReal(
        system, verdict, system.resolved_input, *(resolve_beside(system, one) for one in (output, through))
    )
    if not problem.constant:
        return bracket_norm(problem, tol)
    A = system.resolved.mean()
    period = min(system.period, 1 / (float(np.linalg.norm(A)) + TINY))  # no frequency is folded
    short = PeriodicSystem(A, period, B=problem.B.mean())
    ports = (resolve_constant(one.mean(), period) for one in (problem.B, problem.C, problem.D))
    found = bracket_norm(BoundedReal(short, floquet(short), *ports), tol)
    return replace(found, frequency=abs(float(wrap_angle(np.array(found.frequency * system.period)))) / system.period)


def find_largest_gain(D: ResolvedMatrix) -> float:
    """The largest singular value of D(t), sought in every panel and then about the largest that was seen, closer and closer."""
    if D.constant:
        return float(np.linalg.norm(D.mean(), 2))
    edges = np.union1d(D.edges, np.linspace(0.0, D.period, 65))
    t = (edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0.0, 1.0, 17)[:-1]).ravel()
    best, step = 0.0, float(np.diff(edges).max()) / 16
    for _ in range(8):
        sizes = np.linalg.norm(D(np.mod(t, D.period)), 2, axis=(1, 2))
        best, middle = max(best, float(sizes.max())), t[sizes.argmax()]
        t, step = middle + step * np.linspace(-1.0, 1.0, 33), step / 8
    return best


def bracket_norm(problem: BoundedReal, tol: float) -> HinfNorm:
    """The middle of a level below and a level above the norm, as near to the largest gain that was found as the exponents' errors allow.

    A level that no gain equals is above all of them where it is above one: that at the frequency where the least was found.
    The feedthrough's own gain is the least level; one that is said to lie below, where no larger gain is found, says nothing.
    Raises: ToleranceNotReached when no level exceeds the norm.
    """
    direct = find_largest_gain(problem.D)  # no level below it has a Hamiltonian system
    largest = find_largest_gain(problem.B), find_largest_gain(problem.C)
    if 0 in largest:
        return HinfNorm(direct, tol * direct, 0.0)
    search = PeakSearch(problem, largest, direct)
    if (search.shares <= search.noise).all():  # what is reached is not seen
        unknown = float((SAFETY * search.shares + SLIGHT * search.noise).sum())
        return HinfNorm(direct + unknown, unknown + tol * direct, 0.0)
    search.begin()
    peak, least = search.best[0], search.least()
    low, high, aside, hidden = direct, np.inf, tol / 2, list[float]()
    for _ in range(MOST_STEPS):
        before, unbounded = (low, high), np.isinf(high)
        narrow = high - low <= 2 * tol * high or any(low < one < high for one in hidden)
        if unbounded or (low == direct < min(peak, high) * (1 - aside)):
            level = peak * (1 + aside) if unbounded else min(peak, high) * (1 - aside)
        elif narrow:
            break
        else:
            level = (low + high) / 2
        side, met = problem.judge(level)
        if side < 0 and (not unbounded or search.look_between(met)):
            low = max(low, level)
            if unbounded:
                peak, aside = search.best[0], tol / 2
                continue
        elif side > 0 and level > least:
            high = min(high, level)
            if unbounded:
                continue
        if (low, high) == before:
            hidden.append(level)
        aside *= SAFETY
    if np.isinf(high):
        raise ToleranceNotReached(
            "no level exceeds the norm", got=f"{level:.3g}", todo="is the system nearly unstable?"
        )
    return HinfNorm((low + high) / 2, (high - low) / 2 + EPS * high, search.best[1])
