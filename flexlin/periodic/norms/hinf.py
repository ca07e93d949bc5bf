"""The H-infinity norm of a periodic system: the level at which a Hamiltonian system's multipliers leave the unit circle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive
from flexlin.errors import ArgumentError, NotStable, ToleranceNotReached
from flexlin.lazy import lazy
from flexlin.periodic.coefficients import MatrixFunction, as_matrix_function, check_samples, has_nothing_narrow
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import solve_modes_at_nodes
from flexlin.periodic.norms.h2 import check_ports
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.resolve import resolve
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import represent

ROUGH, FINE = 1e-7, 1e-10
"""Wanted errors of the exponents, in 1/s: in the bisection, and where the level is extrapolated."""
NEGATIVE = 1e-3
"""How far below zero an eigenvalue of X may lie by rounding, in units in which X has a diagonal of ones."""
NEAREST = 1e-9
"""How far above the feedthrough's own gain the lowest level lies of which a Hamiltonian system is made."""
NEAR = 0.01
"""Part of the distance to the circle to which modes are known, so that none is taken for its counterpart."""
STEPS = 200
COARSE = 1e-3
"""Relative width of the bracket from which the level is extrapolated."""
OFFSETS = (4e-3, 2e-3, 1e-3)
"""Relative distances above the level at which the squared real part is taken for the extrapolation."""
CONFIRMED = 1e-7
"""Relative distance on both sides at which the level is confirmed, where its error is not larger."""


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


@dataclass(frozen=True)
class BoundedReal:
    """The Hamiltonian system of a level g, with R = g^2 - D'D, S = g^2 - D D':

        H = [[A + B R^-1 D' C,  g B R^-1 B'], [-g C' S^-1 C,  -(A + B R^-1 D' C)']]

    The norm is below g where no multiplier of H lies on the unit circle and g exceeds every singular value of D(t).
    """

    system: PeriodicSystem
    B: ResolvedMatrix
    C: ResolvedMatrix
    D: ResolvedMatrix

    @lazy
    def breaks(self) -> tuple[float, ...]:
        """Edges of all panels of the coefficients, so that nothing narrow between them is overlooked; none where all are smooth."""
        every = (self.system.resolved, self.B, self.C, self.D)
        return tuple(sorted({time for one in every if one.panels > 1 for time in one.edges[:-1].tolist()}))

    def hamiltonian(self, level: float) -> PeriodicSystem:
        """The system x' = H(t) x of 2 n states."""

        def H(t: Array) -> Array:
            B, C, D = self.B(t), self.C(t), self.D(t)
            turned_B, turned_C, turned_D = (np.swapaxes(one, 1, 2) for one in (B, C, D))
            R = level**2 * np.eye(D.shape[2]) - turned_D @ D
            S = level**2 * np.eye(D.shape[1]) - D @ turned_D
            A = self.system.resolved(t) + B @ np.linalg.solve(R, turned_D @ C)
            upper = np.concatenate([A, level * B @ np.linalg.solve(R, turned_B)], axis=2)
            lower = np.concatenate([-level * turned_C @ np.linalg.solve(S, C), -np.swapaxes(A, 1, 2)], axis=2)
            return np.concatenate([upper, lower], axis=1)

        return PeriodicSystem(H, self.system.period, breaks=self.breaks, complete=True)

    def nearest(self, level: float, tol: float = ROUGH) -> tuple[float, float, float]:
        """The least |Re| of the exponents of H, its error, and the frequency of that exponent in [0, pi/T]."""
        found = floquet(self.hamiltonian(level), tol)
        known = np.isfinite(found.errors)
        size = np.where(known, np.abs(found.exponents.real), np.inf)
        k = int(np.argmin(size))
        return float(size[k]), float(found.errors[k]), float(abs(found.exponents[k].imag))

    def exceeds(self, level: float, tol: float = ROUGH) -> bool:
        """Whether the level lies above the norm: no multiplier of H on the unit circle, and X = V2 V1^-1 >= 0 at all times.

        [V1; V2] are the decaying modes of H. Without the second condition a level between two singular values, each of which keeps its
        distance at all frequencies, would pass.
        """
        system = self.hamiltonian(level)
        found = floquet(system, tol)
        if not np.all(np.abs(found.exponents.real) > 2 * np.where(np.isfinite(found.errors), found.errors, 0.0)):
            return False
        n = self.system.n
        coarse = floquet(system, min(COARSE, NEAR * float(np.abs(found.exponents.real).min())))
        right = solve_modes_at_nodes(system, coarse, quick=True).right[:, :, np.argsort(coarse.exponents.real)[:n]]
        with np.errstate(all="ignore"):
            X = np.linalg.solve(np.swapaxes(right[:, :n], 1, 2), np.swapaxes(right[:, n:], 1, 2)).real
        if not np.isfinite(X).all():
            return False
        units = np.sqrt(np.abs(X[:, range(n), range(n)]).max(axis=0)) + np.finfo(float).tiny
        scaled = X / units / units[:, None]
        return bool(np.linalg.eigvalsh((scaled + np.swapaxes(scaled, 1, 2)) / 2).min() > -NEGATIVE)


def hinf_norm(
    system: PeriodicSystem,
    C: MatrixFunction | ArrayLike,
    D: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> HinfNorm:
    """Compute the H-infinity norm of x' = A x + B u, y = C x + D u: the largest |y| / |u| in mean square.

    A level is bracketed by bisection on whether its Hamiltonian system has multipliers on the unit circle, whose product is never
    formed, and whether its decaying modes make a nonnegative solution of the Riccati equation.
    Two of them meet at the norm, so the squared distance to the circle is smooth in the level, and its zero is extrapolated.
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
    B, output = check_ports(system, C)
    tol = positive("tol", tol)
    rows = check_samples("C", output, system.period).shape[1]
    through = as_matrix_function("D", np.zeros((rows, system.m)) if D is None else D)
    shape = check_samples("D", through, system.period).shape[1:]
    if shape != (rows, system.m):
        raise ArgumentError("D does not fit the system", got=shape, expected=f"({rows}, {system.m})")
    verdict = floquet(system)
    if verdict.verdict != "stable":
        raise NotStable("the norm is infinite or unknown", got=verdict.status, expected="a stable system")
    known = (
        resolve(
            one, system.period, system.breaks, system.features, complete=system.complete and has_nothing_narrow(one)
        )
        for one in (output, through)
    )
    problem = BoundedReal(system, system.resolved_input, *known)
    t = np.linspace(0.0, system.period, 1025)[:-1]
    direct = find_direct_gain(problem.D)
    low, high = bracket_level(problem, direct, float(np.abs(B(t)).max() * np.abs(output(t)).max()))
    return extrapolate_level(problem, low, high, tol, direct) if high > 0 else HinfNorm(0.0, 0.0, 0.0)


def find_direct_gain(D: ResolvedMatrix) -> float:
    """The largest singular value of D(t), sought in every panel and then about the largest that was seen, closer and closer.

    No level below it has a Hamiltonian system.
    """
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


def bracket_level(problem: BoundedReal, direct: float, size: float) -> tuple[float, float]:
    """Levels below and above the norm, COARSE apart; the feedthrough's own gain is the least level."""
    floor = direct * (1 + NEAREST)
    if size == 0:
        return direct, floor
    rate = max(float(np.linalg.norm(problem.system.resolved.mean(), 2)), 1 / problem.system.period)
    low, high = floor, max(2 * floor, size / rate)
    for _ in range(STEPS):
        if problem.exceeds(high):
            break
        low, high = high, 2 * high
    else:
        raise ToleranceNotReached("no level exceeds the norm", got=f"{high:.3g}", todo="is the system nearly unstable?")
    for _ in range(STEPS):
        if low > floor or not low:
            break
        middle = max(floor, high / 2)
        if middle == floor or not problem.exceeds(middle):
            break
        high = middle
    while high - low > COARSE * high and high > 1e-14 * size / rate:
        middle = (low + high) / 2 if low > high / 4 else high / 2 if not low else float(np.sqrt(low * high))
        low, high = (low, middle) if problem.exceeds(middle) else (middle, high)
    return direct if low == floor else low, high


def extrapolate_level(problem: BoundedReal, low: float, high: float, tol: float, direct: float) -> HinfNorm:
    """The level at which the squared real part vanishes, by a parabola through three levels above, again from closer by.

    The error: the distance to the straight line through the two nearest, and what the exponents' errors do. It is confirmed: levels that
    far above exceed the norm, levels that far below do not; where they do not say so, the bracket is the answer.
    """
    center, frequency, error = high, 0.0, high - low
    for scale in (1.0, 0.1, 0.01):
        levels = center * (1 + scale * np.array(OFFSETS))
        found = [problem.nearest(float(level), FINE) for level in levels]
        squares, frequency = np.array([size**2 for size, _, _ in found]), found[-1][2]
        if squares[1] == squares[2] or squares[0] == squares[1] or squares[0] == squares[2]:
            break
        line = levels[2] - squares[2] * (levels[1] - levels[2]) / (squares[1] - squares[2])
        parabola = zero_of_parabola(levels, squares)
        if not (low <= parabola <= levels[2] and np.isfinite(line)):
            break
        slope = (squares[1] - squares[2]) / (levels[1] - levels[2])
        noise = 2 * found[-1][0] * found[-1][1] / abs(slope)
        center, error = parabola, 0.1 * abs(parabola - line) + 4 * noise
        if error <= tol * center:
            break
    apart = max(error, CONFIRMED * center)
    least, most = center - apart, center + apart
    if error < high - low and problem.exceeds(most, FINE) and (least <= direct or not problem.exceeds(least, FINE)):
        return HinfNorm(float(center), float(error), frequency)
    while high - low > max(tol, 1e-12) * high and (low + high) / 2 > direct * (1 + NEAREST):
        middle = (low + high) / 2
        low, high = (low, middle) if problem.exceeds(middle, FINE) else (middle, high)
    return HinfNorm((low + high) / 2, high - low, problem.nearest(high)[2])


def zero_of_parabola(x: Array, y: Array) -> float:
    """The zero of x as a parabola of y (inverse interpolation) through three points."""
    total = 0.0
    for i in range(3):
        others = [j for j in range(3) if j != i]
        total += x[i] * np.prod([-y[j] / (y[i] - y[j]) for j in others])
    return float(total)
