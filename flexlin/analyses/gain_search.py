"""The search for gains: the smoothed largest growth rate over scenarios is minimised at sharper and sharper levels."""

from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scipy.optimize import OptimizeResult, brentq, minimize
from scipy.stats import qmc

from flexlin.analyses.spectra import Family
from flexlin.checks import Array
from flexlin.periodic.boundary.spectra import Effort
from flexlin.precision import CUBE_ROOT_EPS, SLIGHT


def smooth_growth(exponents: Array, periods: Array, mu: float, horizon: float) -> tuple[float, Array]:
    """A smooth bound phi on the largest real part of exponents (S, n) of S loops with periods (S,), and d phi / d lambda (S, n).

        phi = min over s > max Re lambda of   s - mu sum_loops sum_ij log(1 - z_ij),   z_ij = exp((lambda_i + lambda_j - 2 s) N T)

    It tends to the largest with mu -> 0, in 1/s. The inner sum is log det(1 - exp(-2 s N T) Phi (x) Phi), Phi = the transition matrix of
    N periods T: the determinant of the Lyapunov operator, a barrier of stability. It is a symmetric function of the multipliers, so phi is
    analytic in the gains also where they meet. Modes much faster than 1 / (N T) have no part in it. The slopes sum to one.

    Parameters: horizon: the least N T, in s. Returns: infinity where an exponent is no number.
    Source: Fuller, Conditions for a matrix to have only characteristic roots with negative real parts, J. Math. Anal. Appl. 23 (1968)
    71, for the determinant; Vanbiervliet et al., The smoothed spectral abscissa, SIAM J. Optim. 20 (2009) 156, for the idea.
    """
    if not np.isfinite(exponents).all():
        return float("inf"), np.zeros(exponents.shape)
    span = np.asarray(periods * np.ceil(horizon / periods))[:, None, None]
    sums, growths = exponents[:, :, None] + exponents[:, None, :], exponents.real.max(axis=1)
    largest, own = float(growths.max()), float(span[np.argmax(growths), 0, 0])

    def pairs(s: float) -> Array:
        return np.asarray(np.exp((sums - 2 * s) * span))

    def excess(u: float) -> float:  # from infinity down to -1, as the sum is one of squares of traces
        z = pairs(largest + np.exp(u))
        return float(mu * (2 * span * z / (1 - z)).real.sum()) - 1

    longest = float(span.max())
    low = np.log1p(2 * own * mu / (1 + mu * longest * sums.size)) / (2 * own)
    high = np.log1p(2 * longest * mu * sums.size) / (2 * float(span.min()))
    s = largest + float(np.exp(brentq(excess, np.log(low) - 1e-9, np.log(high) + 1e-9, xtol=1e-13)))
    z = pairs(s)
    value = s - mu * float(np.log1p(-z).real.sum())
    return value, np.asarray(mu * (2 * span * z / (1 - z)).sum(axis=2))


SMOOTHING_LEVELS = 0.1 * 0.3 ** np.arange(8)
"""mu in units of the growth rate."""
SMOOTHING_HORIZON = 2.0
"""N T in units of one over the growth rate."""
LEVEL_DECREASE, LEVEL_STEPS = 0.01, 5
"""Relative decrease over so many steps that ends a level's search, as a part of the level: it is smoothed by more than that."""
DIFFERENCE_STEP = 0.02
"""Step of differences by x, in mu per growth rate."""
SCREENED_GAINS = 40
"""Gains that are tried roughly before the best of them are starts."""
AXIS_SCENARIOS, RANDOM_SCENARIOS = 512, 200
"""Scenarios of the verification, a narrow parametric resonance lies at an edge: of an axis, over four for each, and quasi-random ones."""
FEWER_ONE_BY_ONE = 8
"""How many fewer where scenarios are computed one by one."""
WORST_ROUNDS, WORST_ADDED = 6, 3
"""Rounds in which the worst scenarios are added, and as many at once, while they exceed the others by a slight share; rounds of the first
level too, while the growth rate changes by a factor of two."""
CHECKED_SCENARIOS = 12
"""Scenarios of the finer set, beside those of the search, for which time is kept; and spectra that take as long as exact slopes."""
VERIFYING_SPECTRA = 2.5
"""Spectra of a scenario that verification takes: with the gains found and with the first ones, and some to confirm."""


class OutOfTimeError(Exception):
    """The search has used its time: what is left is for the verification."""


@dataclass
class Problem:
    """A loop's exponents over scenarios (S, V) at gains between `low` and `high` (G,), and the best gains seen.

    gain = low (high / low)^u where low is positive, else low + (high - low) u, with u = (1 + sin x) / 2: every x is within the limits.
    `family` takes the gains, then the scenario.
    """

    family: Family
    low: Array
    high: Array
    scenarios: Array
    best: tuple[float, Array] = field(default=(np.inf, np.zeros(0)))
    """The best growth rate and x of all searches with these scenarios."""
    names: tuple[str, ...] = ()
    """Of the gains, then of the scenario's numbers."""
    effort: Effort = field(default_factory=Effort)
    """Seconds of work in which the verification must be done; unfinished where time has ended the search."""

    def straighten(self, gains: Array) -> Array:
        """The gains on the scales on which they are sought."""
        return np.where(self.low > 0, np.log(np.where(self.low > 0, gains, 1.0)), gains)

    def gains(self, x: Array) -> Array:
        """The gains that belong to x."""
        low, high = map(self.straighten, (self.low, self.high))
        straight = low + (high - low) * (1 + np.sin(x)) / 2
        return np.where(self.low > 0, np.exp(np.where(self.low > 0, straight, 0.0)), straight)

    def position(self, gains: Array) -> Array:
        """An x that belongs to gains, or to the nearest ones within the limits."""
        low, high, now = map(self.straighten, (self.low, self.high, np.clip(gains, self.low, self.high)))
        return np.arcsin(np.clip(2 * (now - low) / (high - low) - 1, -0.999, 0.999))

    @property
    def exact(self) -> bool:
        """Whether slopes come from Floquet vectors: many small loops, and those given by functions, take differences."""
        loop = self.family.loop
        return loop is not None and loop.kept is None and not self.family.batched

    def exponents(self, gains: Array, scenarios: Array) -> tuple[Array, Array]:
        """Exponents (S, n), infinite where there are none, and periods (S,) at each scenario; or (G, S, n) for gains (G, P)."""
        several = np.atleast_2d(gains)
        points = np.concatenate([np.repeat(several, len(scenarios), axis=0), np.tile(scenarios, (len(several), 1))], 1)
        periods = self.family.periods(points)
        found = self.effort.timed(self.family.rough)(points).logs / periods[:, None]
        known = np.where(np.isfinite(found).all(axis=1, keepdims=True), found, np.inf)
        return known.reshape(*gains.shape[:-1], len(scenarios), -1), periods[: len(scenarios)]

    def growths(self, gains: Array, scenarios: Array) -> Array:
        """The growth rate at each scenario, (S,), infinite where there is none."""
        return self.exponents(gains, scenarios)[0].real.max(axis=-1)

    def worst(self, x: Array) -> float:
        """The largest growth rate of all scenarios."""
        return float(self.growths(self.gains(x), self.scenarios).max())

    def affordable(self) -> float:
        """Scenarios that can still be verified in time."""
        return self.effort.count(1.0) / VERIFYING_SPECTRA

    def need_time(self, spectra: int) -> None:
        """Raise OutOfTimeError where so many spectra more leave no time for the verification."""
        if self.affordable() < len(self.scenarios) + CHECKED_SCENARIOS + spectra / VERIFYING_SPECTRA:
            self.effort.unfinished = True
            raise OutOfTimeError

    def judge(self, x: Array, mu: float, horizon: float, step: float) -> tuple[float, Array]:
        """The smoothed largest growth rate, in 1/s, and its slopes by x: exact, or by differences over `step`; the best x is kept.

        The smoothed rate is analytic also where exponents meet and have no slopes of their own, so a difference serves.
        Raises: OutOfTimeError.
        """
        h = step * np.eye(len(x))
        places = x[None] if self.exact else np.concatenate([x[None], x + h, x - h])
        self.need_time(len(places) * len(self.scenarios))
        gains = self.gains(places)
        spectra, periods = self.exponents(gains, self.scenarios)
        growth = float(spectra[0].real.max())
        self.best = min(self.best, (growth, x), key=lambda pair: pair[0])
        if not self.exact:
            values = np.array([smooth_growth(one, periods, mu, horizon)[0] for one in spectra])
            return float(values[0]), (values[1 : len(x) + 1] - values[len(x) + 1 :]) / (2 * step)
        shares, slopes = np.abs(smooth_growth(spectra[0], periods, mu, horizon)[1]).sum(axis=1), dict[int, Array]()
        for k in map(int, np.flatnonzero(shares > CUBE_ROOT_EPS)):
            self.need_time(CHECKED_SCENARIOS)
            found = self.family.slopes(np.concatenate([gains[0], self.scenarios[k]]))
            assert found is not None
            spectra[0, k], slopes[k] = found[0], found[2][: len(x)]
        value, weights = smooth_growth(spectra[0], periods, mu, horizon)
        stretch = (self.gains(x + step) - self.gains(x - step)) / (2 * step)
        return value, stretch * sum((one @ weights[k]).real for k, one in slopes.items())


def search(problem: Problem, own: Array, ranges: Array, starts: int, steps: int, seed: int) -> tuple[Array, Array]:
    """Minimise from several starts, then add the worst scenarios of the finer set until none is much worse.

    Returns: the gains, and the finer set of scenarios; where time gives out the best gains so far, and as many scenarios as it does for.
    """
    fewer = 1 if problem.family.batched else FEWER_ONE_BY_ONE
    laid = lay_scenarios(ranges, AXIS_SCENARIOS // fewer // 4 ** len(ranges) + 1)
    fine = np.concatenate([laid, draw_scenarios(ranges, RANDOM_SCENARIOS // fewer, seed + 2)])
    try:
        return minimise(problem, own, starts, steps, seed, fine), fine
    except OutOfTimeError:
        growth, x = problem.best
        found = problem.gains(x) if np.isfinite(growth) else np.clip(own, problem.low, problem.high)
        return found, fine[: int(max(CHECKED_SCENARIOS, problem.affordable() - len(problem.scenarios)))]


def minimise(problem: Problem, own: Array, starts: int, steps: int, seed: int, fine: Array) -> Array:
    """The gains that the search ends with. Raises: OutOfTimeError."""
    screened = SCREENED_GAINS if problem.family.batched else SCREENED_GAINS // FEWER_ONE_BY_ONE
    drawn = np.random.default_rng(seed).uniform(-np.pi / 2, np.pi / 2, (screened, len(own)))
    sizes = [problem.worst(x) for x in drawn[: screened * (starts > 1)]]
    # differences are of spectra that are known to 1e-8
    levels = SMOOTHING_LEVELS if problem.exact else SMOOTHING_LEVELS[:5]
    problem.best = np.inf, problem.position(own)
    for start in (problem.best[1], *drawn[np.argsort(sizes)[: starts - 1]]):
        follow_levels(problem, start, steps, levels)
    for _ in range(WORST_ROUNDS):
        growth, x = problem.best
        growths = problem.growths(problem.gains(x), fine)
        if growths.max() <= growth + SLIGHT * abs(growth):
            break
        problem.scenarios = np.concatenate([problem.scenarios, fine[np.argsort(-growths)[:WORST_ADDED]]])
        problem.best = np.inf, x
        follow_levels(problem, min((x, *drawn), key=problem.worst), steps, levels)
    return problem.gains(problem.best[1])


def follow_levels(problem: Problem, x: Array, steps: int, levels: Array) -> tuple[float, Array]:
    """The best growth rate so far and its x, after these levels.

    The unit of time is the growth rate itself, which may fall a lot at the first level: this is repeated until it stays. Too large a mu,
    or too short a horizon, rewards modes that run off to infinity; too small a mu finds the nearest kink.
    """
    factor = np.eye(len(x))
    for level in levels:
        for _ in range(WORST_ROUNDS if level == levels[0] else 1):
            unit = find_unit(problem, x)
            x, factor = search_level(problem, x, level, unit, steps, factor)
            if 1 / 2 < find_unit(problem, x) / unit < 2:
                break
    return problem.best


def search_level(problem: Problem, x: Array, level: float, unit: float, steps: int, S: Array) -> tuple[Array, Array]:
    """The minimum of the smoothed growth rate at one level, by BFGS, and a factor S of its inverse Hessian S S'.

    The search goes along x + S z, with S of the level before, in whose coordinates the Hessian is near one: in x itself its condition is
    beyond 1e12, and BFGS fails by rounding.
    """
    past = list[float]()

    def judge(z: Array) -> tuple[float, Array]:
        value, slope = problem.judge(x + S @ z, level * unit, SMOOTHING_HORIZON / unit, DIFFERENCE_STEP * level)
        return value, S.T @ slope

    def settle(intermediate_result: OptimizeResult) -> None:
        past.append(float(intermediate_result.fun))
        if len(past) > LEVEL_STEPS and past[-1 - LEVEL_STEPS] - past[-1] <= LEVEL_DECREASE * level * (
            1 + abs(past[-1])
        ):
            raise StopIteration

    options = {"maxiter": steps, "gtol": 0.0}
    with np.errstate(invalid="ignore"):  # of places without a spectrum
        found = minimize(judge, np.zeros(len(x)), jac=True, method="BFGS", callback=settle, options=options)
    try:
        return x + S @ found.x, S @ np.linalg.cholesky((found.hess_inv + found.hess_inv.T) / 2)
    except np.linalg.LinAlgError:
        return x + S @ found.x, S


def find_unit(problem: Problem, x: Array) -> float:
    """The size of the largest growth rate, or a small share of the exponents' sizes where it is smaller, in 1/s."""
    exponents = problem.exponents(problem.gains(x), problem.scenarios)[0]
    finite = exponents[np.isfinite(exponents)]
    return max(abs(float(exponents.real.max())), SLIGHT * float(np.abs(finite).mean())) if len(finite) else 1.0


def lay_scenarios(ranges: Array, each: int) -> Array:
    """A grid of scenarios over ranges (V, 2), ends included; beyond three numbers the corners and as many quasi-random ones."""
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
