"""The numbers of a structured controller that make the slowest decay over all scenarios as fast as possible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexlin.answers.spectra import Source, make_family
from flexlin.answers.tuning.nonsmooth import minimize_nonsmooth
from flexlin.answers.tuning.scenarios import Worst, draw_scenarios, lay_scenarios
from flexlin.answers.tuning.torque import peak_torque, torque_limit
from flexlin.checks import Array, positive, whole
from flexlin.errors import ArgumentError, NotStable
from flexlin.periodic.floquet.exponents import floquet
from flexlin.scene.parameters import get_value, numeric_paths
from flexlin.scene.revised import revise_scene
from flexlin.scene.scene import Scene
from flexlin.summary import represent

SPAN = (0.1, 10.0)
"""Limits of a gain that has none, in its own value."""
SCREENED, SCREEN_GRID = 40, 3
"""Gains that are tried roughly before the best of them are starts, and scenarios of an axis for that."""
GRID, FINE = 4, 7
"""Scenarios of an axis that are tuned on, and that the result is verified on."""
RANDOM, CONFIRMED = 200, 8
"""Quasi-random scenarios of the verification; the worst ones of all that `floquet` confirms."""
ALONE = 8
"""How many fewer where scenarios are computed one by one."""
ROUNDS = 4
NEAR = 0.01
"""Share of the growth rate by which an exponent may lie below the worst and still be active."""


@dataclass(frozen=True)
class ActiveExponent:
    """An exponent that limits the decay: at which scenario, its value and error in 1/s."""

    scenario: dict[str, float]
    exponent: complex
    error: float


@dataclass(frozen=True)
class Tuning:
    """Tuned gains, with what they bring and what limits them.

    Attributes
    ----------
    scene : Scene or None
        The scene with the tuned gains; None where the loop was given by a function.
    gains : dict of str to float
        The tuned gains.
    growth : float
        The largest growth rate over all scenarios of the verification, in 1/s.
    before : float
        The same of the gains that the scene had.
    active : tuple of ActiveExponent
        The exponents that limit the decay, the worst first.
    limits : tuple of str
        What keeps the gains from going on.
    scenarios : int
        How many scenarios the result was verified on.
    status : str
        Before and after in a sentence.

    Examples
    --------
    >>> import flexlin as fl
    >>> def loop(gain, stiffness):
    ...     return fl.PeriodicSystem([[0.0, 1.0], [-stiffness, -gain]], 1.0, B=[[0.0], [1.0]])
    >>> found = fl.tune(loop, {"gain": 0.5}, {"stiffness": (1.0, 4.0)}, {"gain": (0.1, 10.0)})
    >>> print(f"{found.before:.2f} {found.growth:.1f} {found.gains['gain']:.1f}")
    -0.25 -1.0 2.0
    """

    scene: Scene | None
    gains: dict[str, float]
    growth: float
    before: float
    active: tuple[ActiveExponent, ...]
    limits: tuple[str, ...]
    scenarios: int
    status: str

    __repr__ = represent


def tune(
    source: Source,
    gains: Sequence[str] | Mapping[str, float] | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    limits: Mapping[str, Any] | None = None,
    *,
    starts: int = 2,
    steps: int = 15,
    seed: int = 0,
) -> Tuning:
    """Find the gains that make the slowest decay over all scenarios as fast as possible.

        minimise over k:   max over scenarios s, exponents i   of   Re lambda_i(k, s)

    by BFGS with a weak Wolfe line search from several starts, with exact derivatives of the exponents; at the minimum exponents meet,
    where smooth optimisers fail. Scenarios are a grid, refined where the result is worst; the result is verified on a finer set.

    Parameters
    ----------
    source : Scene, or function of numbers -> PeriodicSystem
        The loop; a function takes the gains, then the scenario's numbers.
    gains : sequence of str, or mapping of str to float
        Dotted paths of the gains, by default all numbers of the scene's feedback; for a function their names with first values.
    vary : mapping of str to (float, float), optional
        Dotted paths of the numbers that scenarios differ by, with their ranges.
    limits : mapping, optional
        A path's (low, high), 0 < low < high, by default a tenth and ten times its own value; "torque": the largest torque of the steady
        motion in N m, by default the scene's [drives] or saturation.
    starts : int
        Starts of the search: the gains of the scene, and the best of a rough screening.
    steps : int
        Steps of each search.
    seed : int
        Of the screening.

    Returns
    -------
    Tuning
        scene, gains, growth, before, active, limits, status.

    Raises
    ------
    ArgumentError
        For paths that lead to no free number, and limits that are none.
    NotStable
        When no gains within the limits are stable in all scenarios.

    References
    ----------
    Burke, Lewis, Overton, A robust gradient sampling algorithm for nonsmooth, nonconvex optimization, SIAM J. Optim. 15 (2005) 751;
    Lewis, Overton, Nonsmooth optimization via quasi-Newton methods, Math. Program. 141 (2013) 135.

    Examples
    --------
    >>> import flexlin as fl
    >>> def loop(gain):
    ...     return fl.PeriodicSystem([[0.0, 1.0], [-1.0, -gain]], 1.0)
    >>> print(f"{fl.tune(loop, {'gain': 0.3}, starts=1).growth:.1f}")
    -1.0
    """
    vary, limits = dict(vary or {}), dict(limits or {})
    own = first_gains(source, gains)
    bounds = np.array([gain_bounds(path, value, limits) for path, value in own.items()])
    ranges = np.array(list(vary.values()), dtype=float).reshape(-1, 2)
    spans = {path: (float(a), float(b)) for path, (a, b) in zip(own, bounds, strict=True)}
    family = make_family(source, {**spans, **vary}, "own")
    problem = Worst(family, bounds[:, 0], bounds[:, 1], lay_scenarios(ranges, GRID))
    started = np.array(list(own.values()))
    x, fine = search(problem, started, ranges, whole("starts", starts), whole("steps", steps), seed)
    tuned, capped = keep_torque(source, tuple(own), tuple(vary), started, problem.gains(x), fine, problem, limits)
    return report_tuning(source, problem, tuple(own), tuple(vary), started, tuned, fine, capped)


def first_gains(source: Source, gains: Sequence[str] | Mapping[str, float] | None) -> dict[str, float]:
    """The gains by path, with their first values."""
    if isinstance(gains, Mapping):
        return {path: float(value) for path, value in gains.items()}
    if not isinstance(source, Scene):
        raise ArgumentError("a function's gains need first values", got=repr(gains), expected="{name: value}")
    if gains is None:
        gains = [path for path in numeric_paths(source) if path.startswith("control.feedback.")]
    if not gains or isinstance(gains, str):
        raise ArgumentError("there are no gains to tune", got=repr(gains), expected="dotted paths of numbers")
    return {path: float(get_value(source, path)) for path in gains}


def gain_bounds(path: str, value: float, limits: Mapping[str, Any]) -> tuple[float, float]:
    """The limits of one gain."""
    if path in limits:
        low, high = (positive(f"a limit of {path}", number) for number in limits[path])
    elif value > 0:
        low, high = SPAN[0] * value, SPAN[1] * value
    else:
        raise ArgumentError("a gain that is not positive needs limits", got=f"{path} = {value}", expected="(low, high)")
    if not low < high:
        raise ArgumentError(f"the limits of {path} leave nothing", got=(low, high), expected="low below high")
    return low, high


def search(problem: Worst, own: Array, ranges: Array, starts: int, steps: int, seed: int) -> tuple[Array, Array]:
    """Minimise from several starts, then add the worst scenarios of the finer set until none is much worse.

    Returns: x, and the finer set of scenarios.
    """
    drawn_scenarios, screened = (RANDOM, SCREENED) if problem.batched else (RANDOM // ALONE, SCREENED // ALONE)
    fine = np.concatenate([lay_scenarios(ranges, FINE), draw_scenarios(ranges, drawn_scenarios, seed + 2)])
    coarse = lay_scenarios(ranges, SCREEN_GRID)
    drawn = np.random.default_rng(seed).uniform(-np.pi / 2, np.pi / 2, (screened, len(own)))
    sizes = [float(problem.growths(problem.gains(x), coarse).max()) for x in drawn]
    chosen = [problem.position(np.clip(own, problem.low, problem.high)), *drawn[np.argsort(sizes)[: starts - 1]]]
    found = [minimize_nonsmooth(problem.value, problem.gradient, x, steps) for x in chosen]
    best = min(found, key=lambda one: one.value)
    for _ in range(ROUNDS):
        growth = problem.growths(problem.gains(best.x), fine)
        if growth.max() <= best.value + 1e-3 * abs(best.value):
            break
        problem.scenarios = np.concatenate([problem.scenarios, fine[np.argsort(-growth)[:3]]])
        best = minimize_nonsmooth(problem.value, problem.gradient, best.x, steps)
    return best.x, fine


def keep_torque(
    source: Source, gains: tuple[str, ...], vary: tuple[str, ...], own: Array, tuned: Array, fine: Array, problem: Worst,
    limits: Mapping[str, Any],
) -> tuple[Array, str]:  # fmt: skip
    """The gains, or those on the way to them from the scene's own that keep the torque's limit, and what that says."""
    limit = torque_limit(source, limits)
    if limit is None or not isinstance(source, Scene):
        return tuned, ""
    worst = fine[np.argsort(-problem.growths(tuned, fine))[:1]]
    corners = np.concatenate([fine[fine.argmax(axis=0)], worst]) if fine.shape[1] else fine

    def keeps(numbers: Array) -> bool:
        revised = revise_scene(source, dict(zip(gains, map(float, numbers), strict=True)))
        return all(peak_torque(revised, dict(zip(vary, map(float, one), strict=True))) <= limit for one in corners)

    if keeps(tuned):
        return tuned, ""
    if not keeps(own):
        return tuned, f"the torque of {limit:g} N m is exceeded by the scene's own gains too"
    low, high = 0.0, 1.0
    for _ in range(8):
        middle = (low + high) / 2
        low, high = (middle, high) if keeps(own * (tuned / own) ** middle) else (low, middle)
    return own * (tuned / own) ** low, f"the torque of the steady motion, at most {limit:g} N m"


def report_tuning(
    source: Source, problem: Worst, gains: tuple[str, ...], vary: tuple[str, ...], own: Array, tuned: Array, fine: Array,
    capped: str,
) -> Tuning:  # fmt: skip
    """Confirm the result by `floquet` where it is worst, and say what it brings and what limits it.

    Raises: NotStable where a scenario is not stable.
    """
    every = np.concatenate([problem.scenarios, fine])
    growth = problem.growths(tuned, every)
    active = []
    for k in np.argsort(-growth)[:CONFIRMED]:
        result = floquet(problem.family.system_at(np.concatenate([tuned, every[k]])))
        scenario = dict(zip(vary, map(float, every[k]), strict=True))
        if result.verdict != "stable":
            raise NotStable(
                "no gains within the limits are stable in all scenarios", got=f"{result.verdict} at {scenario}",
                expected="gains that hold everywhere", todo="widen the limits, or narrow the scenarios",
            )  # fmt: skip
        for exponent, error in zip(result.exponents, result.errors, strict=True):
            if exponent.imag >= 0:
                active.append(ActiveExponent(scenario, complex(exponent), float(error)))
    active.sort(key=lambda one: -one.exponent.real)
    worst = active[0].exponent.real
    active = [one for one in active if one.exponent.real >= worst + NEAR * worst]
    before = float(problem.growths(own, every).max())
    bound = [
        f"{path} at its limit of {edge:g}"
        for path, value, low, high in zip(gains, tuned, problem.low, problem.high, strict=True)
        for edge in (low, high)
        if abs(np.log(value / edge)) < 1e-2 * np.log(high / low)
    ]
    meeting = f"{len(active)} exponents meet" if len(active) > 1 else "one exponent at one scenario"
    named = (*bound, *([capped] if capped else []), meeting)
    numbers = dict(zip(gains, map(float, tuned), strict=True))
    scene = revise_scene(source, numbers) if isinstance(source, Scene) else None
    status = (
        f"the slowest decay over {len(every)} scenarios goes from {-before:.4g} to {-worst:.4g} 1/s; "
        f"what limits it: {'; '.join(named)}"
    )
    return Tuning(scene, numbers, float(worst), before, tuple(active), named, len(every), status)
