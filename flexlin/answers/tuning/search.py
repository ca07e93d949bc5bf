"""The search for gains: the smoothed growth rate is minimised at sharper and sharper levels, over the scenarios that matter."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.answers.tuning.scenarios import CHECKED, OutOfTimeError, Smoothing, Worst, draw_scenarios, lay_scenarios
from flexlin.checks import Array

ARMIJO, WOLFE = 1e-4, 0.5
"""Share of the linear decrease that a step must reach, and of the slope that it may leave."""
BISECTIONS = 20
PATIENCE = 5
"""Steps over which too small a decrease ends the search."""


@dataclass(frozen=True)
class Minimum:
    """The best point, its value, and a factor S of the inverse Hessian H = S S'."""

    x: Array
    value: float
    factor: Array


def descend(
    f: Callable[[Array], float],
    gradient: Callable[[Array], Array],
    x: Array,
    steps: int,
    settled: float,
    factor: Array | None = None,
) -> Minimum:
    """Minimise by BFGS with a weak Wolfe line search.

        f(x + t p) <= f(x) + c1 t g'p,   g(x + t p)' p >= c2 g'p,   p = -S S' g

    H is kept as S S', brought up to date by an orthogonal factorization: it stays positive where its condition is beyond 1e12, and there
    the plain update fails by rounding. Parameters: f may return infinity; settled: relative decrease over five steps that ends the search;
    factor: S of an earlier search nearby.
    Source: Lewis, Overton, Nonsmooth optimization via quasi-Newton methods, Math. Program. 141 (2013) 135.
    """
    value, g, S = f(x), gradient(x), np.eye(len(x)) if factor is None else factor
    past = [value]
    for step in range(steps):
        p = -S @ (S.T @ g)
        slope = float(g @ p)
        if not np.isfinite(slope) or slope >= 0:
            break
        first = 1.0 if step or factor is not None else min(1.0, 0.5 / float(np.linalg.norm(g)))
        t, found, new_g = search_line(f, gradient, x, p, value, g, first)
        if not found < value:
            break
        s, y = t * p, new_g - g
        x, value, g = x + s, found, new_g
        S = update_factor(S, s, y, scaled=step == 0 and factor is None)
        past.append(value)
        if len(past) > PATIENCE and past[-1 - PATIENCE] - value <= settled * (1 + abs(value)):
            break
    return Minimum(x, value, S)


def search_line(
    f: Callable[[Array], float],
    gradient: Callable[[Array], Array],
    x: Array,
    p: Array,
    value: float,
    g: Array,
    t: float,
) -> tuple[float, float, Array]:
    """A step that meets the weak Wolfe conditions, by doubling and halving alone; no derivative is trusted to be continuous.

    Returns: the step, the value and the gradient there; infinity where none descends.
    """
    slope, low, high, best = float(g @ p), 0.0, np.inf, np.inf
    for _ in range(BISECTIONS):
        now = f(x + t * p)
        if not now <= value + ARMIJO * t * slope:
            high = t
        else:
            low, best, g = t, now, gradient(x + t * p)
            if float(g @ p) >= WOLFE * slope:
                break
        t = (low + high) / 2 if np.isfinite(high) else 2 * low
    return low, best, g


def update_factor(S: Array, s: Array, y: Array, scaled: bool) -> Array:
    """S of (I - s y'/c) S S' (I - y s'/c) + s s'/c, c = s'y; unchanged where the curvature c is not positive.

    Parameters: scaled: make H fit the first step's curvature before.
    """
    c = float(y @ s)
    if not c > 1e-14 * float(np.linalg.norm(y) * np.linalg.norm(s)):
        return S
    if scaled:
        S = S * np.sqrt(c / float(y @ y))
    left = S - np.outer(s, y @ S) / c
    return np.asarray(np.linalg.qr(np.column_stack([left, s / np.sqrt(c)]).T)[1].T)


LEVELS = (0.1, 0.03, 0.01, 3e-3, 1e-3, 5e-4, 3e-4, 2e-4, 1e-4)
"""mu in units of the growth rate."""
LEVELS_TOGETHER = (0.1, 0.02, 4e-3, 1e-3)
"""The same where scenarios are computed together: their spectra are known to 1e-8."""
RACED = 2
"""Levels after which only the best start goes on."""
HORIZON = 2.0
"""N T in units of one over the growth rate."""
UNITS, FIRST = (1 / 16, 1 / 4, 1.0, 4.0), 60
"""Units that are tried at first, in the growth rate of the start, and steps of these trials."""
SMALL = 1e-3
"""The least unit, in mean sizes of an exponent."""
AGAIN, CHANGED = 5, 2.0
"""How often the first level is repeated while the growth rate still changes by this factor."""
SETTLED = 0.01
"""Relative decrease over a few steps that ends a level's search, as a part of the level: it is smoothed by more than that."""
DIFFERENCE = 0.02
"""Step of differences by x, in mu per growth rate."""
SCREENED, GRID = 40, 3
"""Gains that are tried roughly before the best of them are starts, and scenarios of an axis at first."""
FINE, RANDOM = {1: 129, 2: 33, 3: 9}, 200
"""Scenarios of an axis by the number of axes, and quasi-random ones, of the verification: a narrow parametric resonance lies at an edge."""
ALONE = 8
"""How many fewer where scenarios are computed one by one."""
ROUNDS, WORSE, ADDED = 6, 1e-3, 3
"""Rounds in which the worst scenarios are added, as many at once, while they exceed the others by this share."""


def search(problem: Worst, own: Array, ranges: Array, starts: int, steps: int, seed: int) -> tuple[Array, Array]:
    """Minimise from several starts, then add the worst scenarios of the finer set until none is much worse.

    Returns: the gains, and the finer set of scenarios; where time gives out the best gains so far, and as many scenarios as it does for.
    """
    drawn_scenarios = RANDOM if problem.batched else RANDOM // ALONE
    each = FINE.get(len(ranges), 0) if problem.batched else 7
    fine = np.concatenate([lay_scenarios(ranges, each), draw_scenarios(ranges, drawn_scenarios, seed + 2)])
    try:
        return minimise(problem, own, ranges, starts, steps, seed, fine), fine
    except OutOfTimeError:
        growth, x = problem.ever
        found = problem.gains(x) if np.isfinite(growth) else np.clip(own, problem.low, problem.high)
        return found, fine[: max(CHECKED, int(problem.affordable()) - len(problem.scenarios))]


def minimise(problem: Worst, own: Array, ranges: Array, starts: int, steps: int, seed: int, fine: Array) -> Array:
    """The gains that the search ends with. Raises: OutOfTimeError."""
    screened = SCREENED if problem.batched else SCREENED // ALONE
    drawn = np.random.default_rng(seed).uniform(-np.pi / 2, np.pi / 2, (screened, len(own)))
    sizes = [float(problem.growths(problem.gains(x)).max()) for x in drawn[: screened * (starts > 1)]]
    chosen = [problem.position(np.clip(own, problem.low, problem.high)), *drawn[np.argsort(sizes)[: starts - 1]]]
    levels = LEVELS_TOGETHER if problem.batched else LEVELS
    raced = [
        follow_levels(problem, begin(problem, x, steps), steps, levels[: RACED if len(chosen) > 1 else None])
        for x in chosen
    ]
    growth, x = min(raced, key=lambda one: one[0])
    if len(chosen) > 1:
        growth, x = follow_levels(problem, x, steps, levels[RACED:])
    seen = [x for _, x in raced]
    for _ in range(ROUNDS):
        growths = problem.growths(problem.gains(x), fine)
        if growths.max() <= growth + WORSE * abs(growth):
            break
        seen.append(x)
        problem.scenarios = np.concatenate([problem.scenarios, fine[np.argsort(-growths)[:ADDED]]])
        problem.ever = np.inf, x
        x = min((*seen, *drawn), key=lambda one: float(problem.growths(problem.gains(one)).max()))
        growth, x = follow_levels(problem, x, steps, levels[RACED:] if x is seen[-1] else levels)
    return problem.gains(x)


def begin(problem: Worst, x: Array, steps: int) -> Array:
    """The best x of short searches with several units of time: nobody knows how fast a decay there may be.

    Too large a mu, or too short a horizon, rewards modes that run off to infinity; too small a mu finds the nearest kink.
    """
    own, found = find_unit(problem, x), []
    for factor in UNITS:
        end = search_level(problem, x, LEVELS[0], factor * own, min(steps, FIRST)).x
        found.append((float(problem.growths(problem.gains(end)).max()), end))
    return min(found, key=lambda one: one[0])[1]


def follow_levels(problem: Worst, x: Array, steps: int, levels: tuple[float, ...]) -> tuple[float, Array]:
    """The best growth rate and its x, after these levels.

    The unit of time is the growth rate itself, which may fall a lot at the first level: this is repeated until it stays.
    """
    problem.best, factor = (np.inf, x), None
    for level in levels:
        for _ in range(AGAIN if level == levels[0] else 1):
            unit = find_unit(problem, x)
            result = search_level(problem, x, level, unit, steps, factor)
            x, factor = result.x, result.factor
            if 1 / CHANGED < find_unit(problem, x) / unit < CHANGED:
                break
    return problem.best


def search_level(
    problem: Worst, x: Array, level: float, unit: float, steps: int, factor: Array | None = None
) -> Minimum:
    """The minimum of the smoothed growth rate at one level."""
    smoothing, step = Smoothing(level * unit, HORIZON / unit), DIFFERENCE * level
    return descend(
        lambda at: problem.value(at, smoothing), lambda at: problem.gradient(at, smoothing, step), x, steps, SETTLED * level, factor
    )  # fmt: skip


def find_unit(problem: Worst, x: Array) -> float:
    """The size of the largest growth rate, or a small share of the exponents' sizes where it is smaller, in 1/s."""
    exponents = problem.exponents(problem.gains(x), problem.scenarios)[0]
    finite = exponents[np.isfinite(exponents)]
    return max(abs(float(exponents.real.max())), SMALL * float(np.abs(finite).mean())) if len(finite) else 1.0
