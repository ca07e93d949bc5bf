"""The H-infinity norm of a periodic system: the level at which a Hamiltonian system's multipliers leave the unit circle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive
from flexlin.errors import ArgumentError, NotStable, ToleranceNotReached
from flexlin.lazy import lazy
from flexlin.periodic.assignment import assign
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.coefficients import (
    Constant,
    MatrixFunction,
    as_matrix_function,
    check_samples,
    has_nothing_narrow,
)
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import solve_modes_at_nodes
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.norms.h2 import check_ports
from flexlin.periodic.precision import CUBE, EPS, MINOR, SLIGHT, TINY
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.resolve import resolve
from flexlin.periodic.roots import MOST
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import represent

BESIDE, GROWTH = 0.01, 8.0
"""Of the way from the level at which the distance is predicted to vanish to the bracket's end: how far beside it the next one is tried; and
the factor from level to level until one is above the norm."""


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

        if all(one.constant for one in (self.system.resolved, self.B, self.C, self.D)):
            return PeriodicSystem(H(np.zeros(1))[0], self.system.period)
        return PeriodicSystem(H, self.system.period, breaks=self.breaks, complete=True)

    def judge(self, level: float) -> "Level":
        """On which side of the norm a level lies, as far as the exponents of H show it.

        Above: no multiplier lies on the unit circle, where X says so too. Below: one lies there, since no other one is near that could be
        its mirror image in the circle.
        """
        system = self.hamiltonian(level)
        found = floquet(system)
        known = np.isfinite(found.errors)
        errors, size = np.where(known, found.errors, 0.0), np.where(known, np.abs(found.exponents.real), np.inf)
        frequency = float(abs(found.exponents[int(np.argmin(size))].imag))
        if np.all(size > 2 * errors):
            return Level(level, 1, frequency, system, found)
        logs = found.log_multipliers
        apart = measure_distances(logs, logs) / system.period
        alone = (apart > 2 * (errors + errors[:, None])) | np.eye(len(logs), dtype=bool)
        return Level(level, -int(np.any((size <= errors) & alone.all(axis=1))), frequency, system, found)

    def judge_solution(self, system: PeriodicSystem, found: FloquetResult) -> int:
        """1 where the decaying modes [V1; V2] of H make X = V2 V1^-1 >= 0 at all times, -1 where X is indefinite by more than it lacks
        in symmetry, else 0. Without it a level between two singular values, each of which keeps its distance at all frequencies, would
        be above the norm."""
        n = self.system.n
        if isinstance(system.A, Constant):
            from scipy.linalg import schur  # takes longer to load than most matrices to solve

            right = np.array([schur(system.A.value, sort="lhp")[1][:, :n]])
        else:
            right = solve_modes_at_nodes(system, found, quick=True).right[:, :, np.argsort(found.exponents.real)[:n]]
        with np.errstate(all="ignore"):
            X = np.linalg.solve(np.swapaxes(right[:, :n], 1, 2), np.swapaxes(right[:, n:], 1, 2)).real
        if not np.isfinite(X).all():
            return 0
        mean = np.abs(self.system.resolved.mean()) + TINY
        own = np.sqrt(mean.sum(axis=1) / mean.sum(axis=0))
        units = np.sqrt(np.abs(X[:, range(n), range(n)]).max(axis=0))
        units = np.maximum(units, SLIGHT * (units / own).max() * own) + TINY
        scaled = X / units / units[:, None]
        turned = np.swapaxes(scaled, 1, 2)
        least, doubt = float(np.linalg.eigvalsh((scaled + turned) / 2).min()), float(np.abs(scaled - turned).max())
        told_apart = np.abs(found.exponents.real).min() * system.period > CUBE
        return 1 if least > -SLIGHT else -int(told_apart and least < -n * doubt - SLIGHT)


@dataclass(frozen=True)
class Level:
    """A level, its side of the norm (1 above, -1 below, 0 where errors hide it), the frequency of the multiplier nearest to the circle in
    [0, pi/T], and its Hamiltonian system."""

    value: float
    side: int
    frequency: float
    system: PeriodicSystem
    found: FloquetResult


def hinf_norm(
    system: PeriodicSystem,
    C: MatrixFunction | ArrayLike,
    D: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> HinfNorm:
    """Compute the H-infinity norm of x' = A x + B u, y = C x + D u: the largest |y| / |u| in mean square.

    The norm lies between two levels: above, the Hamiltonian system has no multiplier on the unit circle, whose product is never
    formed, and its decaying modes make a nonnegative solution of the Riccati equation; below, one lies there. Two of them meet at the
    norm, so the squared distance to the circle is smooth in the level and says where to look next. The error is half of the distance of
    the two levels. Assumes a stable system.

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
    _, output = check_ports(system, C)
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
    return bracket_norm(problem, find_largest_gain(problem.B) * find_largest_gain(problem.C), tol)


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


def bracket_norm(problem: BoundedReal, size: float, tol: float) -> HinfNorm:
    """The middle of a level below and a level above the norm, as near to each other as tol asks, or as the exponents' errors allow.

    Above the norm the squared distance to the circle is linear in the level; where it is predicted to vanish, levels on both sides are
    tried. The feedthrough's own gain is the least level. The first and the last level above are proved by their X.
    Raises: ToleranceNotReached when no level exceeds the norm.
    """
    direct = find_largest_gain(problem.D)  # no level below it has a Hamiltonian system
    if size == 0:
        return HinfNorm(direct, tol * direct, 0.0)
    rate = max(float(np.linalg.norm(problem.system.resolved.mean(), 2)), 1 / problem.system.period)
    low, floor = direct, max(direct * (1 + tol), EPS**0.9 * size / rate)
    high, frequency, above, hidden, proved = np.inf, 0.0, list[Level](), list[float](), np.inf
    wary, level = False, max(2 * floor, size / rate)
    for _ in range(MOST):
        near = [one for one in hidden if low < one < high]
        first, last = (min(near), max(near)) if near else (high, low)
        closed = high - low <= tol * high or high <= floor
        closed |= bool(near) and max(first - low, high - last) <= max(tol * high, MINOR * (high - low))
        if proved != high < np.inf and (closed or proved == np.inf):
            side = problem.judge_solution(above[-1].system, above[-1].found)
            if side > 0:
                proved = high
            else:
                low, hidden = (high, hidden) if side < 0 else (low, [*hidden, high])
                level, high, above, wary = GROWTH * high, proved, [], True
            continue
        if high < np.inf:
            if closed:
                break
            level = choose_level(low, high, above, tol, floor)
            if near:
                level = (low + first) / 2 if first - low > high - last else (last + high) / 2
        one = problem.judge(level)
        side = problem.judge_solution(one.system, one.found) if one.side > 0 and wary else one.side
        if side > 0:
            proved = level if wary else proved
            high, above = level, [*above[-1:], one]
            frequency = one.frequency if low == direct else frequency
        elif side < 0:
            low, frequency = level, one.frequency
        else:
            hidden.append(level)
        level = GROWTH * level if np.isinf(high) else level
    if np.isinf(proved):
        raise ToleranceNotReached(
            "no level exceeds the norm", got=f"{level:.3g}", todo="is the system nearly unstable?"
        )
    return HinfNorm((low + proved) / 2, (proved - low) / 2, frequency)


def choose_level(low: float, high: float, above: list[Level], tol: float, floor: float) -> float:
    """The next level to look at between two: beside the predicted norm, or half-way.

    The norm is predicted by the mode that meets its mirror image first; modes that no level moves are unseen or not reached.
    """
    if len(above) > 1:
        first, second = above
        far, near = (one.found.log_multipliers[one.found.exponents.real < 0] for one in (first, second))
        partner = assign(measure_distances(near, far)) if len(near) == len(far) else np.arange(0)
        before, now = far[partner].real ** 2, near.real[: len(partner)] ** 2
        moved = before - now > SLIGHT * before
        zeros = second.value - now[moved] * (first.value - second.value) / (before - now)[moved]
        zero = float(zeros[zeros > low].max(initial=-np.inf))
        reach = max(tol * high / 4, BESIDE * (high - zero)) if np.isfinite(zero) else 0.0
        for level in (zero + reach, zero - reach):
            if max(low, floor) < level < high * (1 - tol / 8):
                return level
    return max(floor, (low + high) / 2 if low > high / 4 else high / 4 if low < floor else float(np.sqrt(low * high)))
