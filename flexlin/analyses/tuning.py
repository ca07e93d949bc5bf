"""The numbers of a structured controller that make the slowest decay over all scenarios as fast as possible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flexlin.analyses.boundary import check_limits
from flexlin.analyses.gain_search import Problem, lay_scenarios, search
from flexlin.analyses.judging import find_response
from flexlin.analyses.spectra import SCAN_ERROR, Source, make_family
from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive, whole
from flexlin.control.drives import drive_load
from flexlin.errors import ArgumentError, NotStable, counted
from flexlin.linearization.linear import linearize
from flexlin.mechanics import build_manipulator
from flexlin.periodic.boundary.spectra import Effort
from flexlin.periodic.floquet.exponents import floquet
from flexlin.scene.loading import revise_scene
from flexlin.scene.parameters import get_value, numeric_paths
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

CONFIRMED_SCENARIOS = 8
"""The worst scenarios of all that `floquet` confirms."""
ACTIVE_SHARE = 0.01
"""Share of the growth rate by which an exponent may lie below the worst and still be active."""


@dataclass(frozen=True)
class ActiveExponent:
    """An exponent that limits the decay: at which scenario, its value and error in 1/s."""

    scenario: dict[str, float]
    exponent: complex
    error: float


@immutable
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


@checked
def tune(
    source: Source,
    gains: Sequence[str] | Mapping[str, float] | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    limits: Mapping[str, Any] | None = None,
    *,
    starts: int = 2,
    steps: int = 300,
    seed: int = 0,
    tol: float = 1e-9,
    seconds: float | None = None,
) -> Tuning:
    """Find the gains that make the slowest decay over all scenarios as fast as possible.

        minimise over k:   max over scenarios s, exponents i   of   Re lambda_i(k, s)

    At the minimum exponents meet, and their maximum has corners and infinite slopes there. A smooth bound takes its place, the barrier of
    Lyapunov's operator, which is analytic in the gains; BFGS minimises it at sharper and sharper levels, from several starts. Scenarios
    are a coarse grid, to which the worst of a finer set are added; the result is verified on the finer set.

    Parameters
    ----------
    source : Scene, or function of numbers -> PeriodicSystem
        The loop; a function takes the gains, then the scenario's numbers.
    gains : sequence of str, or mapping of str to float
        Dotted paths of the gains, by default all numbers of the scene's feedback; for a function their names with first values.
    vary : mapping of str to (float, float), optional
        Dotted paths of the numbers that scenarios differ by, with their ranges.
    limits : mapping, optional
        A path's (low, high), by default a tenth and ten times its own value; where low is positive the gain is sought on a logarithmic
        scale. "torque": the largest torque of the steady motion in N m, beside the limits of the scene's [drives] and saturation.
    starts : int
        Starts of the search: the gains of the scene, and the best of a rough screening.
    steps : int
        Steps of each search at each level.
    seed : int
        Of the screening.
    tol : float
        Wanted error of the exponents by which the result is confirmed, relative beyond 1/s.
    seconds : float
        Time after which the best gains so far are verified and handed back, by default as long as it takes.

    Returns
    -------
    Tuning
        scene, gains, growth, before, active, limits, status.

    Raises
    ------
    ArgumentError
        For paths that lead to no free number, and limits that are none.
    NotStable
        When the search found no gains that are stable in all scenarios.

    References
    ----------
    Burke, Henrion, Lewis, Overton, Stabilization via nonsmooth, nonconvex optimization, IEEE Trans. Autom. Control 51 (2006) 1760;
    Vanbiervliet et al., The smoothed spectral abscissa, SIAM J. Optim. 20 (2009) 156;
    Lewis, Overton, Nonsmooth optimization via quasi-Newton methods, Math. Program. 141 (2013) 135.

    Examples
    --------
    >>> import flexlin as fl
    >>> def loop(gain):
    ...     return fl.PeriodicSystem([[0.0, 1.0], [-1.0, -gain]], 1.0)
    >>> print(f"{fl.tune(loop, {'gain': 0.3}, starts=1).growth:.1f}")
    -1.0
    """
    until, tol = np.inf if seconds is None else positive("seconds", seconds), positive("tol", tol)
    vary, limits = dict(vary or {}), dict(limits or {})
    own = first_gains(source, gains)
    possible = [*own, *["torque"] * isinstance(source, Scene)]
    if strange := [path for path in limits if path not in possible]:
        raise ArgumentError(
            "limits are of what is tuned", got=", ".join(strange), expected=f"some of {', '.join(possible)}"
        )
    bounds = np.array([gain_bounds(path, value, limits) for path, value in own.items()])
    ranges = np.array(list(vary.values()), dtype=float).reshape(-1, 2)
    spans = {path: (float(a), float(b)) for path, (a, b) in zip(own, bounds, strict=True)}
    family = replace(make_family(source, {**spans, **vary}, "own"), finest=SCAN_ERROR)
    names = (*own, *vary)
    problem = Problem(family, bounds[:, 0], bounds[:, 1], lay_scenarios(ranges, 3), names=names, effort=Effort(until))
    started = np.array(list(own.values()))
    x, fine = search(problem, started, ranges, whole("starts", starts), whole("steps", steps), seed)
    tuned, capped = keep_torque(source, problem, started, x, fine, limits)
    return report_tuning(source, problem, started, tuned, fine, capped, tol)


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
    """The limits of one gain, by default a tenth and ten times its own value."""
    if path in limits:
        return check_limits(path, limits[path])
    if not value > 0:
        raise ArgumentError("a gain that is not positive needs limits", got=f"{path} = {value}", expected="(low, high)")
    return 0.1 * value, 10.0 * value


def keep_torque(
    source: Source, problem: Problem, own: Array, tuned: Array, fine: Array, limits: Mapping[str, Any]
) -> tuple[Array, str]:
    """The gains, or those on the way to them from the scene's own that keep the torque's limit, and what that says."""
    given = positive("the limit of the torque", limits["torque"]) if "torque" in limits else np.inf
    if not isinstance(source, Scene) or (
        given == np.inf and source.control.saturation is None and source.drives is None
    ):
        return tuned, ""
    worst = fine[np.argsort(-problem.growths(tuned, fine))[:1]]
    corners = np.concatenate([fine[fine.argmax(axis=0)], worst]) if fine.shape[1] else fine

    def keeps(numbers: Array) -> bool:
        points = (named(problem.names, np.concatenate([numbers, one])) for one in corners)
        return all(use_torque(revise_scene(source, point), given) <= 1 for point in points)

    if keeps(tuned):
        return tuned, ""
    if not keeps(own):
        return tuned, "a joint's torque exceeds its limit with the scene's own gains too"
    ends = problem.position(np.clip(own, problem.low, problem.high)), problem.position(tuned)
    low, high = 0.0, 1.0
    for _ in range(8):
        middle = (low + high) / 2
        kept = keeps(problem.gains(ends[0] + middle * (ends[1] - ends[0])))
        low, high = (middle, high) if kept else (low, middle)
    return problem.gains(ends[0] + low * (ends[1] - ends[0])), "a joint's torque in the steady motion is at its limit"


def report_tuning(
    source: Source, problem: Problem, own: Array, tuned: Array, fine: Array, capped: str, tol: float
) -> Tuning:
    """Confirm the result by `floquet` where it is worst, and say what it brings and what limits it.

    Raises: NotStable where a scenario is not stable.
    """
    every = np.array(list(dict.fromkeys(map(tuple, np.concatenate([problem.scenarios, fine]).tolist()))))
    gains, vary = problem.names[: len(own)], problem.names[len(own) :]
    growth = problem.growths(tuned, every)
    active = []
    for k in np.argsort(-growth)[:CONFIRMED_SCENARIOS]:
        result = floquet(problem.family.system_at(np.concatenate([tuned, every[k]])), tol)
        scenario = named(vary, every[k])
        if result.verdict != "stable":
            what, got = "the search found no gains that are stable in all scenarios", result.verdict
            got += f" at {scenario}" if scenario else ""
            todo = "widen the limits, or narrow the scenarios"
            raise NotStable(what, got=got, expected="gains that hold everywhere", todo=todo)
        pairs = zip(result.exponents.tolist(), result.errors.tolist(), strict=True)
        active += [ActiveExponent(scenario, exponent, error) for exponent, error in pairs if exponent.imag >= 0]
    active.sort(key=lambda one: -one.exponent.real)
    worst = active[0].exponent.real
    active = [one for one in active if one.exponent.real >= worst + ACTIVE_SHARE * worst]
    before = float(problem.growths(own, every).max())
    bound = [
        f"{path} at its limit of {edge:g}"
        for path, value, low, high in zip(gains, tuned, problem.low, problem.high, strict=True)
        for edge in (low, high)
        if abs(value - edge) < ACTIVE_SHARE * min(abs(edge) or np.inf, high - low)
    ]
    meeting = f"{len(active)} exponents meet" if len(active) > 1 else "one exponent at one scenario"
    ended = "the time, which ended the search" if problem.effort.unfinished else ""
    limits = tuple(filter(None, (*bound, capped, ended, meeting)))
    numbers = named(gains, tuned)
    scene = revise_scene(source, numbers) if isinstance(source, Scene) else None
    goes = f"the slowest decay over {counted(len(every), 'scenario')} goes from {-before:.4g} to {-worst:.4g} 1/s"
    status = f"{goes}; what limits it: {'; '.join(limits)}"
    return Tuning(scene, numbers, float(worst), before, tuple(active), limits, len(every), status)


def named(paths: tuple[str, ...], numbers: Array) -> dict[str, float]:
    """Numbers by their paths."""
    return dict(zip(paths, numbers.tolist(), strict=True))


def use_torque(scene: Scene, given: float) -> float:
    """The largest share that the scene's steady motion takes of a joint's torque: of the limit given, of its saturation, of its drive's."""
    lin = linearize(build_manipulator(scene), scene.motion, scene.control)
    t = lin.period * np.arange(SAMPLES) / SAMPLES
    states = find_response(lin, lin.periodic_system(), t, SCAN_ERROR).states
    load, saturation = drive_load(lin, t, states, lin.law, scene.drives), scene.control.saturation
    of_drives = [demand.limit or np.inf for demand in load.demands if demand.what == "peak torque"]
    limit = np.minimum(of_drives, given if saturation is None else np.minimum(saturation.torque, given))
    return float((np.abs(load.torque).max(axis=0) / limit).max(initial=0.0))
