"""Norms of a periodic system: H2 by its periodic Lyapunov equation, H-infinity by levels at which multipliers leave the unit circle."""

from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.circle import measure_distances, wrap_angle
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficients import MatrixFunction, assemble_hamiltonian, combine
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import MODES_TOL, floquet_modes
from flexlin.periodic.floquet.result import FloquetResult, need_stable
from flexlin.periodic.interpolation import fourier_nodes
from flexlin.periodic.related import PeriodicStateSpace
from flexlin.periodic.response.frequency import Segments, condense
from flexlin.periodic.riccati.riccati import periodic_lyapunov
from flexlin.periodic.roots import MOST_STEPS
from flexlin.periodic.system import PeriodicSystem, edges_between
from flexlin.periodic.transition.choose_segments import FEWER_SEGMENTS, choose_setting, find_rule, place_segments
from flexlin.periodic.transition.gauss import Tableau, place_nodes, sample_at
from flexlin.precision import EPS, FAINT, MINOR, PARTIAL, SAFETY, SLIGHT, TINY
from flexlin.summary import immutable

INPUT_HARMONICS, START_MODES = 8, 3
"""Harmonics of inputs that are tried; modes about whose frequencies the largest gain is sought, and as many steps to it."""


@immutable
class H2Norm:
    """The H2 norm and a bound on its error, in units of the output per root of the unit of white noise on the inputs.

    Attributes
    ----------
    value : float
        The norm.
    error : float
        Of the value.
    status : str
        What to make of it.

    Examples
    --------
    >>> import flexlin as fl
    >>> print(f"{fl.h2_norm(fl.PeriodicSystem([[-2.0]], 1.0, B=[[1.0]]), [[1.0]]).value:.6f}")
    0.500000
    """

    value: float
    error: float
    status: str


def describe_norm(value: float, error: float, tol: float) -> str:
    """What to make of a norm."""
    if error <= max(tol * value, TINY):
        return "converged"
    if error >= value:
        return f"rounding hides the norm: it is at most {value + error:.3g}; bring states, inputs and outputs to like sizes"
    return f"limited by rounding: known to {error / value:.1g} of the value, not to the asked {tol:.1g}"


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
        value, error, status.

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
    plant = PeriodicStateSpace(system, C)
    system, B = plant.system, plant.system.resolved_input
    solution = periodic_lyapunov(
        system, combine(lambda C: np.swapaxes(C, 1, 2) @ C, plant.C), MINOR * positive("tol", tol)
    )
    corners = np.union1d(solution.edges, B.edges)
    power = resolve(combine(reach, B, solution.X), system.period, corners[:-1].tolist(), complete=True)
    square, quadrature = float(power.mean()[0, 0]), float(power.mean_error(corners[[0, -1]])[0, 0, 0])
    t = fourier_nodes(SAMPLES, system.period)
    doubt = float(
        reach(np.abs(B(t)), np.broadcast_to(solution.entry_errors, (len(t), *solution.entry_errors.shape))).mean()
    )
    doubt += SAFETY * quadrature
    value = float(np.sqrt(max(square, 0.0)))
    error = float(doubt / (2 * value) if value**2 > doubt else np.sqrt(abs(square) + doubt))
    return H2Norm(value, error, describe_norm(value, error, tol))


def reach(B: Array, X: Array) -> Array:
    """trace(B' X B), (N, 1, 1)."""
    return np.einsum("tki,tkl,tli->t", B, X, B)[:, None, None]


@dataclass(frozen=True)
class BoundedReal:
    """The Hamiltonian system of a level g, with R = g^2 - D'D, S = g^2 - D D':

        H = [[A + B R^-1 D' C,  g B R^-1 B'], [-g C' S^-1 C,  -(A + B R^-1 D' C)']]

    The norm is below g where no multiplier of H lies on the unit circle and g exceeds every singular value of D(t).
    """

    plant: PeriodicStateSpace
    found: FloquetResult

    @property
    def constant(self) -> bool:
        """Whether nothing depends on t."""
        return all(one.constant for one in self.plant.series)

    def hamiltonian(self, level: float) -> PeriodicSystem:
        """The system x' = H(t) x of 2 n states."""

        def H(t: Array) -> Array:
            A, B, C, D = (one(t) for one in self.plant.series)
            turned_B, turned_C, turned_D = (np.swapaxes(one, 1, 2) for one in (B, C, D))
            R = level**2 * np.eye(D.shape[2]) - turned_D @ D
            S = level**2 * np.eye(D.shape[1]) - D @ turned_D
            A = A + B @ np.linalg.solve(R, turned_D @ C)
            forth, back = level * B @ np.linalg.solve(R, turned_B), level * turned_C @ np.linalg.solve(S, C)
            return assemble_hamiltonian(A, -forth, back)

        if self.constant:
            return PeriodicSystem(H(np.zeros(1))[0], self.plant.system.period)
        edges = edges_between(*self.plant.series)  # nothing narrow between them is overlooked
        return PeriodicSystem(H, self.plant.system.period, breaks=edges, complete=True)

    def constant_gain(self, omega: float) -> float:
        """|C (i omega - A)^-1 B + D|, where nothing depends on t."""
        A, B, C, D = (one.mean() for one in self.plant.series)
        return float(np.linalg.norm(C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B) + D, 2))

    def segments(self, edges: Array, rule: Tableau) -> Segments:
        """The system's, as they serve all frequencies; inputs and outputs so weighted that their squares add up to the integrals."""
        t, h = place_nodes(edges, rule.c), np.diff(edges)
        A, B, C, D = (sample_at(one, t) for one in self.plant.series)
        found, (p, m) = condense(A, B, C, D, h, rule), D.shape[-2:]
        by = np.sqrt(h[:, None] * rule.b)
        into, out = 1 / np.repeat(by, m, axis=1)[:, None], np.repeat(by, p, axis=1)[..., None]
        return Segments(found.free, found.pushed * into, found.seen * out, found.through * out * into)

    def judge(self, level: float) -> tuple[int, Array]:
        """On which side of the norm a level lies (1 above, -1 below, 0 where errors hide it), and at which frequencies a gain equals it.

        Below: a multiplier lies on the circle, since no other one is near that could be its mirror image in it. Above: as many grow as
        have mirror images that decay.
        """
        found = floquet(self.hamiltonian(level))
        known, grows = np.isfinite(found.errors), found.exponents.real > 2 * found.errors
        errors, size = np.where(known, found.errors, 0.0), np.where(known, np.abs(found.exponents.real), np.inf)
        logs = found.log_multipliers
        apart = measure_distances(logs, logs) / found.period
        alone = (apart > 2 * (errors + errors[:, None])) | np.eye(len(logs), dtype=bool)
        crossing = (size <= errors) & alone.all(axis=1)
        side = 1 if 2 * grows.sum() == len(logs) else -int(crossing.any())
        return side, np.unique(np.abs(found.exponents.imag[crossing]))


def measure_parts(port: Array, vectors: Array, largest: float) -> tuple[Array, Array]:
    """The largest parts of modes in a port over a period, and what these would be if nothing in them cancelled.

    Infinite and 0 where a pulse of the port hides between the times.
    """
    if np.linalg.norm(port, 2, axis=(1, 2)).max() <= (1 - MINOR) * largest:
        return np.array(np.inf), np.array(0.0)
    part, whole = (np.linalg.norm(one, axis=1).max(axis=0) for one in (port @ vectors, np.abs(port) @ np.abs(vectors)))
    return part, whole


class PeakSearch:
    """The largest gain |y| / |u| under inputs exp(i omega t) v(t), v periodic, sought about the frequencies of the modes.

    shares: what each mode adds to a gain at the most, |c_i| |b_i| / |Re lambda_i| with the largest b_i = q_i^H B and c_i = C p_i;
    noise: what rounding may make of them; best: the largest gain and its frequency.
    """

    def __init__(self, problem: BoundedReal, largest: list[float], direct: float):
        self.problem, system, found = problem, problem.plant.system, problem.found
        _, B, C, _ = problem.plant.series
        rate = max(float(np.linalg.norm(system.resolved.mean(), 2)), 1 / system.period)
        self.floor = max(direct, EPS * largest[0] * largest[1] / rate)  # what rounding makes of nothing
        modes = floquet_modes(system, found)
        reached, all_reached = measure_parts(np.swapaxes(B(modes.times), 1, 2), modes.left.conj(), largest[0])
        seen, all_seen = measure_parts(C(modes.times), modes.right, largest[1])
        self.exponents, self.period, damping = modes.exponents, system.period, np.abs(modes.exponents.real)
        self.shares = np.where(np.isfinite(modes.errors), reached * seen / damping, np.inf)
        self.noise = FAINT * all_reached * all_seen / damping
        self.gains: dict[float, float] = {}

    def begin(self) -> None:
        """Try the frequencies of the modes that add most, on segments of a level near them all, and climb from the best."""
        greatest = float(self.shares[np.isfinite(self.shares)].max(initial=0.0))
        near = self.problem.hamiltonian(max(greatest, 2 * self.floor))
        self.setting = choose_setting(near, MODES_TOL)
        if self.setting.segments > FEWER_SEGMENTS:  # an L-stable method only knows the modes that it resolves
            self.setting = choose_setting(self.problem.plant.system, MODES_TOL, "radau")
        self.edges = place_segments(near, self.setting)
        self.segments = cache(partial(self.problem.segments, self.edges))
        first = self.exponents[np.argsort(-self.shares)].imag[: 2 * START_MODES]
        for omega in (0.0, np.pi / self.period, *first.tolist()):
            self.gain(omega)
        self.climb(self.best[1])

    @property
    def best(self) -> tuple[float, float]:
        """The largest gain that was found, and its frequency."""
        return max((gain, omega) for omega, gain in self.gains.items())

    def gain(self, omega: float) -> float:
        """The gain at a frequency, remembered for it folded into [0, pi/T]."""
        omega = fold_frequency(omega, self.period)
        if omega not in self.gains:
            self.gains[omega] = self.measure(omega)
        return self.gains[omega]

    def measure(self, omega: float, better: int = 0) -> float:
        """The gain at a frequency by segments of an order that is so much better, sought from inputs of some harmonics."""
        if self.problem.constant:
            return max(self.problem.constant_gain(omega), self.floor)
        rule = find_rule(self.setting.method, self.setting.order + better)
        orders = np.arange(-INPUT_HARMONICS, INPUT_HARMONICS + 1)
        t, m = place_nodes(self.edges, rule.c), self.problem.plant.system.m
        waves = np.exp(1j * (omega + 2 * np.pi / self.period * orders) * t[..., None])
        tried = np.einsum("ks,ksl,ij->ksilj", np.sqrt(np.diff(self.edges)[:, None] * rule.b), waves, np.eye(m))
        found = self.segments(rule).largest_gain(
            np.exp(1j * omega * self.period), tried.reshape(len(t), -1, m * len(orders))
        )
        return max(found, self.floor)

    def climb(self, omega: float) -> None:
        """Go to the largest gain near a frequency: about a resonance 1 / gain^2 is a parabola, as wide as the mode is damped."""
        step, top = PARTIAL * abs(float(self.exponents[np.abs(np.abs(self.exponents.imag) - omega).argmin()].real)), 0.0
        for _ in range(START_MODES):
            middle = self.gain(omega) ** -2.0
            if abs(middle - top) <= MODES_TOL * middle:
                return
            before, behind = (self.gain(omega + k * step) ** -2.0 for k in (-1, 1))
            bend = before - 2 * middle + behind
            turn = START_MODES * float(np.sign(before - behind))
            if bend > 0:
                turn = (before - behind) / (2 * bend)
            top = middle - bend * turn**2 / 2
            omega += step * float(np.clip(turn, -START_MODES, START_MODES))
            step *= MINOR if abs(turn) < 1 else 1.0
        self.gain(omega)

    def look_between(self, crossings: Array) -> bool:
        """Climb from the middles between frequencies at which gains equal a level that lies below some; whether a larger one is there."""
        before = self.best[0]
        marks = np.concatenate([[0.0], crossings, [np.pi / self.period]])
        middles = ((marks[1:] + marks[:-1]) / 2).tolist()
        self.climb(max(middles, key=self.gain))
        return self.best[0] > before

    def between(self, omega: float) -> tuple[float, float]:
        """What the gain at a frequency that was tried is not below and not above, by two orders."""
        found, again = self.gains[omega], self.measure(omega, better=4)
        apart = SAFETY * abs(again - found)
        return min(found, again) - apart, max(found, again) + apart


@immutable
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
    status : str
        What to make of it.

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
    status: str


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
        value, error, frequency, status.

    Raises
    ------
    ArgumentError
        When the system has no input, or a matrix does not fit.
    NotStable
        When the system is not stable: then the norm is infinite.
    ToleranceNotReached
        When the levels about the norm are more than a factor of three apart.

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
    plant, tol = PeriodicStateSpace(system, C, D), positive("tol", tol)
    found = floquet(plant.system)
    need_stable(found, "the norm is infinite or unknown")
    problem, T = BoundedReal(plant, found), plant.system.period
    if problem.constant:
        means = [one.mean() for one in plant.series]
        period = min(T, 1 / (float(np.linalg.norm(means[0])) + TINY))  # no frequency is folded
        plant = PeriodicStateSpace(PeriodicSystem(means[0], period, B=means[1]), *means[2:])
        problem = BoundedReal(plant, floquet(plant.system))
    value, error, omega = bracket_norm(problem, tol)
    return HinfNorm(value, error, fold_frequency(omega, T), describe_norm(value, error, tol))


def fold_frequency(omega: float, period: float) -> float:
    """The frequency in [0, pi/T] of the same waves."""
    return abs(float(wrap_angle(np.array(omega * period)))) / period


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


def bracket_norm(problem: BoundedReal, tol: float) -> tuple[float, float, float]:
    """The middle of a level below and a level above the norm, as near to the largest gain that was found as the exponents' errors allow;
    its error, and the gain's frequency.

    A level that no gain equals is above all of them where it is above one: that at the frequency where the least was found.
    The feedthrough's own gain is the least level; one that is said to lie below, where no larger gain is found, says nothing.
    Raises: ToleranceNotReached when the two lie so far apart that their middle says little.
    """
    _, *ports = problem.plant.series
    *largest, direct = map(find_largest_gain, ports)  # no level below the last one has a Hamiltonian system
    if 0 in largest:
        return direct, tol * direct, 0.0
    search = PeakSearch(problem, largest, direct)
    if (search.shares <= search.noise).all():  # what is reached is not seen
        unknown = float((SAFETY * search.shares + SLIGHT * search.noise).sum())
        return direct + unknown, unknown + tol * direct, 0.0
    search.begin()
    peak, (_, least) = search.best[0], search.between(min(search.gains, key=search.gains.__getitem__))
    low, high, aside, hidden = direct, np.inf, tol / 2, list[float]()
    for _ in range(MOST_STEPS):
        before, unbounded = (low, high), np.isinf(high)
        narrow = high - low <= 2 * tol * high or any(low < one < high for one in hidden)
        if unbounded and aside > 1 / PARTIAL:
            break
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
    if low < (1 - 2 * tol) * high and not problem.constant and search.best[0] > search.floor:
        low = max(low, search.between(search.best[1])[0])
    if low < PARTIAL * high:
        raise ToleranceNotReached(
            "rounding hides the norm: the levels that are known to lie below and above it are far apart",
            got=f"{low:.3g} and {high:.3g}",
            expected=f"more than {PARTIAL:g} of the upper one",
            todo="is the system nearly unstable? add damping, or take states of like sizes",
        )
    return (low + high) / 2, (high - low) / 2 + EPS * high, search.best[1]
