"""The exponents of a loop over scenarios as functions of its gains, and the slope of their smoothed largest growth rate."""

from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.optimize import brentq
from scipy.stats import qmc

from flexlin.about.free import ParametricLoop
from flexlin.answers.sensitivity import integrate_derivatives
from flexlin.answers.spectra import Family, SymbolicFamily
from flexlin.checks import Array
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import FloquetModes, differentiate_exponents, solve_floquet_modes
from flexlin.resources import Stopwatch


@dataclass(frozen=True)
class Smoothing:
    """A smooth bound on the largest real part of the exponents of some loops, which tends to it with mu -> 0.

        phi = min over s > max Re lambda of   s - mu sum_loops sum_ij log(1 - z_ij),   z_ij = exp((lambda_i + lambda_j - 2 s) N T)

    The inner sum is log det(1 - exp(-2 s N T) Phi (x) Phi), Phi = the transition matrix of N periods T: the determinant of the Lyapunov
    operator, a barrier of stability. It is a symmetric function of the multipliers, so phi is analytic in the gains also where they
    meet. Modes much faster than 1 / (N T) have no part in it.
    `mu`: in 1/s; `horizon`: the least N T, in s.
    Source: Fuller, Conditions for a matrix to have only characteristic roots with negative real parts, J. Math. Anal. Appl. 23 (1968)
    71, for the determinant; Vanbiervliet et al., The smoothed spectral abscissa, SIAM J. Optim. 20 (2009) 156, for the idea.
    """

    mu: float
    horizon: float

    def value(self, exponents: Array, periods: Array) -> float:
        """phi of the exponents (S, n) of S loops with periods (S,); infinite where one is no number."""
        if not np.isfinite(exponents).all():
            return float("inf")
        span = self.span(periods)
        s = self.solve(exponents, span)
        return s - self.mu * float(np.log1p(-self.pairs(exponents, span, s)).real.sum())

    def weights(self, exponents: Array, periods: Array, s: float) -> Array:
        """d phi / d lambda (S, n) at the s that belongs to phi; they sum to one."""
        span = self.span(periods)
        z = self.pairs(exponents, span, s)
        return np.asarray(self.mu * (2 * span * z / (1 - z)).sum(axis=2))

    def level(self, exponents: Array, periods: Array) -> float:
        """The s at which phi is taken."""
        return self.solve(exponents, self.span(periods))

    def span(self, periods: Array) -> Array:
        """N T of each loop, in the shape of pairs."""
        return np.asarray(periods * np.ceil(self.horizon / periods))[:, None, None]

    def pairs(self, exponents: Array, span: Array, s: float) -> Array:
        """z (S, n, n)."""
        return np.asarray(np.exp((exponents[:, :, None] + exponents[:, None, :] - 2 * s) * span))

    def solve(self, exponents: Array, span: Array) -> float:
        """s from   1 = mu sum 2 N T z / (1 - z);   the right-hand side falls from infinity to zero, as it is a sum of squares of traces."""
        largest, count, longest = float(exponents.real.max()), exponents.size * exponents.shape[1], float(span.max())
        top = int(np.argmax(exponents.real.max(axis=1)))
        own = float(span[top, 0, 0])

        def excess(u: float) -> float:
            z = self.pairs(exponents, span, largest + np.exp(u))
            return float(self.mu * (2 * span * z / (1 - z)).real.sum()) - 1

        low = np.log1p(2 * own * self.mu / (1 + self.mu * longest * count)) / (2 * own)
        shortest = float(span.min())
        high = np.log1p(2 * longest * self.mu * count) / (2 * shortest)
        return largest + float(np.exp(brentq(excess, np.log(low) - 1e-9, np.log(high) + 1e-9, xtol=1e-13)))


GRADIENT_TOL = 1e-8
"""Accuracy of the exponents that gradients belong to, in 1/s."""
STEP = 1e-6
"""Relative step of the differences that stand for dA where a loop is given by a function."""
FAINT = 1e-5
"""A scenario whose weights are all below this has no part in a gradient."""
CHECKED = 12
"""Scenarios of the finer set, beside those of the search, for which time is kept."""
EXACT = 12
"""Spectra that take as long as the exact slopes of one scenario."""
TWICE = 2.5
"""Spectra of a scenario that verification takes: with the gains found and with the first ones, and some to confirm."""


class OutOfTimeError(Exception):
    """The search has used its time: what is left is for the verification."""


@dataclass
class Worst:
    """A loop's exponents over scenarios (S, V) at gains between `low` and `high` (G,), and the best gains seen.

    gain = low (high / low)^u where low is positive, else low + (high - low) u, with u = (1 + sin x) / 2: every x is within the limits.
    `family` takes the gains, then the scenario.
    """

    family: Family
    low: Array
    high: Array
    scenarios: Array
    best: tuple[float, Array] = field(default=(np.inf, np.zeros(0)))
    until: float = np.inf
    """Seconds of work in which the verification must be done."""
    watch: Stopwatch = field(default_factory=Stopwatch)
    ever: tuple[float, Array] = field(default=(np.inf, np.zeros(0)))
    """The best growth rate and x of all searches with these scenarios."""
    taken: tuple[float, int] = (0.0, 0)
    """Time in s and number of the spectra so far."""
    ended: bool = False
    """Whether time has ended the search."""

    def gains(self, x: Array) -> Array:
        """The gains that belong to x."""
        u, power = (1 + np.sin(x)) / 2, self.low > 0
        base = np.where(power, self.low, 1.0)
        return np.where(power, base * (self.high / base) ** u, self.low + (self.high - self.low) * u)

    def position(self, gains: Array) -> Array:
        """An x that belongs to gains within the limits."""
        power = self.low > 0
        low, high, now = (np.log(np.where(power, one, 1.0)) for one in (self.low, self.high, gains))
        straight = (gains - self.low) / (self.high - self.low)
        u = np.where(power, (now - low) / np.where(power, high - low, 1.0), straight)
        return np.arcsin(np.clip(2 * u - 1, -0.999, 0.999))

    def stretch(self, x: Array) -> Array:
        """d gain / dx."""
        power = self.low > 0
        ratio = np.log(np.where(power, self.high, 1.0) / np.where(power, self.low, 1.0))
        return np.where(power, self.gains(x) * ratio, self.high - self.low) * np.cos(x) / 2

    @property
    def loop(self) -> ParametricLoop | None:
        """The equations, where they keep the numbers as symbols."""
        loop = self.family.loop if isinstance(self.family, SymbolicFamily) else None
        return None if loop is None or loop.kept is not None else loop

    @property
    def batched(self) -> bool:
        """Whether many scenarios are computed together."""
        return isinstance(self.family, SymbolicFamily) and self.loop is not None and self.family.together is not None

    def exponents(self, gains: Array, scenarios: Array) -> tuple[Array, Array]:
        """Exponents (S, n), infinite where there are none, and periods (S,) at each scenario; or (G, S, n) for gains (G, P)."""
        several = np.atleast_2d(gains)
        points = np.concatenate([np.repeat(several, len(scenarios), axis=0), np.tile(scenarios, (len(several), 1))], 1)
        begun, periods = self.watch.seconds, self.periods(points)
        found = self.family.rough(points).logs / periods[:, None]
        self.taken = self.taken[0] + self.watch.seconds - begun, self.taken[1] + len(points)
        known = np.where(np.isfinite(found).all(axis=1, keepdims=True), found, np.inf)
        return known.reshape(*gains.shape[:-1], len(scenarios), -1), periods[: len(scenarios)]

    def growths(self, gains: Array, scenarios: Array | None = None) -> Array:
        """The growth rate at each scenario, (S,), infinite where there is none."""
        return self.exponents(gains, self.scenarios if scenarios is None else scenarios)[0].real.max(axis=-1)

    def periods(self, points: Array) -> Array:
        """T in s at points (N, P)."""
        if isinstance(self.family, SymbolicFamily) and self.family.loop is not None:
            return self.family.loop.periods(points)
        return np.array([self.family.system_at(point).period for point in points])

    def affordable(self) -> float:
        """Scenarios that can still be verified in time."""
        spent, count = self.taken
        return (self.until - self.watch.seconds) * count / (TWICE * spent) if spent else np.inf

    def need_time(self, spectra: int) -> None:
        """Raise OutOfTimeError where so many spectra more leave no time for the verification."""
        if self.affordable() < len(self.scenarios) + CHECKED + spectra / TWICE:
            self.ended = True
            raise OutOfTimeError

    def value(self, x: Array, smoothing: Smoothing) -> float:
        """The smoothed largest growth rate, in 1/s; the best gains are kept. Raises: OutOfTimeError."""
        self.need_time(len(self.scenarios))
        gains = self.gains(x)
        exponents, periods = self.exponents(gains, self.scenarios)
        growth = float(exponents.real.max())
        if growth < self.best[0]:
            self.best = growth, x
        if growth < self.ever[0]:
            self.ever = growth, x
        return smoothing.value(exponents, periods)

    def gradient(self, x: Array, smoothing: Smoothing, step: float) -> Array:
        """Its derivative by x: by differences of many small loops computed together, else by left and right Floquet vectors.

        The smoothed rate is analytic also where exponents meet and have no slopes of their own, so a difference over `step` serves.
        Raises: OutOfTimeError.
        """
        if self.batched:
            self.need_time(2 * len(x) * len(self.scenarios))
            ends = np.concatenate([x + step * np.eye(len(x)), x - step * np.eye(len(x))])
            spectra, periods = self.exponents(np.array([self.gains(end) for end in ends]), self.scenarios)
            values = np.array([smoothing.value(one, periods) for one in spectra])
            return (values[: len(x)] - values[len(x) :]) / (2 * step)
        gains = self.gains(x)
        exponents, periods = self.exponents(gains, self.scenarios)
        s = smoothing.level(exponents, periods)
        shares = np.abs(smoothing.weights(exponents, periods, s)).sum(axis=1)
        slope = np.zeros(len(x))
        for k in np.flatnonzero(shares > FAINT):
            self.need_time(EXACT)
            found, slopes = self.slopes(np.concatenate([gains, self.scenarios[k]]))
            weights = smoothing.weights(found[None], periods[k : k + 1], s)[0]
            slope += (slopes[: len(gains)] @ weights).real
        return slope * self.stretch(x)

    def slopes(self, point: Array) -> tuple[Array, Array]:
        """Exponents (n,) and their exact derivatives by the gains at one point."""
        if self.loop is not None:
            loop = replace(self.loop, linearization=self.loop.at(point))
            system = loop.linearization.periodic_system()
            modes = solve_floquet_modes(system, floquet(system, GRADIENT_TOL), quick=True)
            return modes.exponents, integrate_derivatives(loop, modes)
        system = self.family.system_at(point)
        modes = solve_floquet_modes(system, floquet(system, GRADIENT_TOL), quick=True)
        return modes.exponents, differentiate_exponents(modes, self.changes(point, modes))

    def changes(self, point: Array, modes: FloquetModes) -> Array:
        """dA / d gain (G, N, n, n) at the modes' times, by differences."""
        changes = []
        for i in range(len(self.low)):
            h = STEP * max(abs(float(point[i])), 1e-3)
            sides = [self.family.system_at(point + s * h * np.eye(len(point))[i]).A(modes.times) for s in (1, -1)]
            changes.append((sides[0] - sides[1]) / (2 * h))
        return np.array(changes)


def lay_scenarios(ranges: Array, each: int) -> Array:
    """A grid of scenarios over ranges (V, 2), ends included; beyond three numbers the corners and as many quasi-random ones."""
    if not len(ranges):
        return np.zeros((1, 0))
    if len(ranges) <= 3:
        return np.array(list(product(*[np.linspace(low, high, each) for low, high in ranges])))
    corners = np.array(list(product(*ranges)))
    return np.concatenate([corners[:256], draw_scenarios(ranges, 8 * each, 1)])


def draw_scenarios(ranges: Array, count: int, seed: int) -> Array:
    """Quasi-random scenarios over ranges (V, 2)."""
    if not len(ranges):
        return np.zeros((1, 0))
    unit = qmc.Halton(len(ranges), seed=seed).random(count)
    return np.asarray(ranges[:, 0] + unit * (ranges[:, 1] - ranges[:, 0]))
