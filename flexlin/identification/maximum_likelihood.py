"""Numbers of a scene that make a log most likely, with their errors, and what the log cannot say."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array, positive, whole
from flexlin.errors import ArgumentError, NumericalError, SceneError
from flexlin.identification.equations import Logged
from flexlin.identification.least_squares import Evidence, Point, Problem, leave_unknown, solve, weigh_evidence
from flexlin.identification.log import Log
from flexlin.identification.prediction import (
    START_SECONDS,
    Prediction,
    deviations,
    find_starts,
    name_missed,
    predict,
    prepare,
    say_fit,
)
from flexlin.identification.shooting import Windows
from flexlin.mechanics.effects import effects_of
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.plots.view import Series, Shown, View
from flexlin.precision import MINOR, SAFETY, SLIGHT
from flexlin.resources import Stopwatch, part
from flexlin.scene.links import DIRECTIONS
from flexlin.scene.loading import parse_scene, raw_tables, revise_scene
from flexlin.scene.names import show_unit
from flexlin.scene.parameters import get_value, need_numbers, path_in
from flexlin.scene.scene import MOST_UNCERTAIN, Scene
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray

ROUNDS = 20
"""Times that noise, and shapes of links that carry fitted masses, are found anew."""
FIRST_STEPS = 30
"""Gauss-Newton steps before that at the most: noise that is found far from the minimum misleads."""
STEPS, NEW_STEPS = 2, 3
"""Gauss-Newton steps of a round, and of one with new shapes, for which all is simulated anew."""
HEAD_SHARE = 0.25
"""Share of a window that is its head."""
FAR_FACTOR = 10.0
"""A number that changes by more, where residuals are coloured, may make up for a column's wrong sign or unit."""
SETTLED_NOISE = 0.02
"""Relative change of the noise below which it is known."""
BLOCKED_ERRORS = 1.0
"""Standard errors that one more undamped step promises, from which on its not being taken is worth a word."""
FIRST_GAIN = SLIGHT
"""Share of the cost that a step still gains where the first steps go on."""
FREED_DAMPING = MINOR
"""Largest damping with which a round begins: one that came to a halt tries larger steps again."""
STILL_ERRORS = MINOR
"""Standard errors by which a round may still move a number of a search that has settled, and by which two ends of searches may differ
that are the same: one more search would end there too."""
HEAD_STARTS, HEAD_STEPS = 2, 4
"""Starting values that are compared by heads beside the scene's, and Gauss-Newton steps that each is given there."""
SEARCH_SHARE = 0.6
"""Share of the time after which no step is begun: one may take long, and so may the prediction."""


@immutable(eq=False)
class Identification(Shown):
    """Numbers of a scene by a measured log.

    Attributes
    ----------
    scene : Scene
        With all numbers as the search left them, and two standard errors of each that is known to both sides as its [uncertainty].
    values, errors : dict of str to float
        The numbers that the log knows, and one standard error of each; not a number at a limit, or where the search has not settled.
    unknown : tuple of tuple of str
        Numbers that it does not know: those of a group can change together without any reading's changing.
    covariance : array, shape (k, k)
        Of `values`.
    correlations : dict of str to float
        Of pairs of numbers that go together by 0.9 or more.
    fit : dict of str to float
        By column in percent, over the part that was kept back, else over what was fitted.
    noise : dict of str to float
        Standard deviation of each column about its prediction.
    colour : dict of str to float
        Correlation of neighbouring residuals of each column; the errors allow for it.
    prediction : Prediction
        Of the part that `fit` is about.
    settled : bool
        Whether noise and numbers stayed where they were before time or rounds ended.
    status : str
        What was found, and what to do.

    Examples
    --------
    >>> from dataclasses import fields
    >>> from flexlin.identification import Identification
    >>> [field.name for field in fields(Identification)][:3]
    ['scene', 'values', 'errors']
    """

    scene: Scene
    values: dict[str, float]
    errors: dict[str, float]
    unknown: tuple[tuple[str, ...], ...]
    covariance: Array
    correlations: dict[str, float]
    fit: dict[str, float]
    noise: dict[str, float]
    colour: dict[str, float]
    prediction: Prediction
    settled: bool
    status: str

    def to_xarray(self) -> "xarray.Dataset":
        """Return numbers, errors and covariance as a dataset.

        Returns
        -------
        xarray.Dataset
            By the numbers' paths, with the prediction's readings.
        """
        import xarray

        numbers = {
            "value": ("path", list(self.values.values())),
            "error": ("path", list(self.errors.values())),
            "covariance": (("path", "other"), self.covariance),
        }
        paths = list(self.values)
        return self.prediction.to_xarray().merge(xarray.Dataset(numbers, coords={"path": paths, "other": paths}))

    def _view(self) -> View:
        errors = {path: f" ± {error:.2g}" if np.isfinite(error) else "" for path, error in self.errors.items()}
        said = ((path, f"{value:.5g}{errors[path]}") for path, value in self.values.items())
        facts = [f"{path} = {number} {show_unit(self.scene, path)}".rstrip() for path, number in said]
        facts += map(say_fit, self.fit, self.fit.values())
        view = self.prediction._view()
        gone = {name: m - self.prediction.outputs[name] for name, m in self.prediction.measured.items()}
        worst = min(self.fit, key=lambda name: self.fit[name])
        series = (*view.series, Series("residual", self.prediction.time, gone[worst]))
        return View("identification", "", (*facts, self.status), view.x_label, view.y_label, series)


@checked
def identify(
    scene: Scene,
    log: Log,
    free: Iterable[str],
    window: float = 2.0,
    hold_back: float = 0.0,
    starts: int = 3,
    seconds: float | None = None,
) -> Identification:
    """Find numbers of a scene from a measured log by maximum likelihood.

        min over p and the starting state of each window   sum_j N_j log |reading_j - h_j(x, u, p)|

    Each window is simulated from a free starting state (output errors, multiple shooting), so drift of a window does not reach the next;
    the noise of each column is white, of a size that is found. Where residuals are coloured, errors come from their covariances up to a
    quarter of a window and from sums over such quarters, whichever are wider. Derivatives are exact. Assumes inputs without noise.

    Parameters
    ----------
    scene : Scene
        The arm; its numbers are where the search begins.
    log : Log
        What was measured.
    free : iterable of str
        Dotted paths of numbers to find; gains, offsets and delays of the [log] table too.
    window : float
        Length of a window, in s.
    hold_back : float
        Share of the log, at its end, that is not fitted but predicted.
    starts : int
        Searches at the most, of which the likeliest counts: from the scene's own values, then, where residuals are not white or a
        number is at its end, from the best over a quarter of each window of some within a factor of about two.
    seconds : float
        Time after which the most likely numbers so far are handed back, by default as long as it takes.

    Returns
    -------
    Identification
        The numbers, their errors, and the scene with them.

    Raises
    ------
    ArgumentError
        When a path leads to no number, or the log does not fit the scene.
    NumericalError
        When the equations diverge from every start.

    References
    ----------
    Ljung, System Identification (1999), chapters 7 and 9; Bock (1983), multiple shooting with Gauss-Newton; Patterson, Thompson
    (1971), Biometrika 58, 545: noise by what numbers and starting states leave of the readings, not by all of them.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 0, "effects.gravity": "off", "designs": []})
    >>> t = np.arange(300) * 0.01
    >>> log = fl.Log(t, inputs={"q1": 0 * t}, outputs={"q1": 0 * t})
    >>> fl.identify(scene, log, ["effects.payload.mass"], starts=1).unknown
    (('effects.payload.mass',),)
    """
    paths = [path_in(scene, path) for path in free]
    if not paths or len(set(paths)) < len(paths):
        raise ArgumentError("free numbers are named once each", got=", ".join(paths) or "none", expected="dotted paths")
    if not 0 <= hold_back < 0.9:
        raise ArgumentError("the share that is kept back does not fit", got=hold_back, expected="0 to 0.9")
    watch, most = Stopwatch(), np.inf if seconds is None else SEARCH_SHARE * positive("seconds", seconds)
    edge = log.time[-1] - hold_back * (log.time[-1] - log.time[0])
    fitted, held = (log.part(log.time[0], edge), log.part(edge, log.time[-1])) if hold_back else (log, log)
    low, high = find_limits(scene, paths)
    search = Search(scene, fitted, paths, low, high, lambda: watch.clock >= most)
    windows = Windows.of(fitted, positive("window", window))
    with part(0.0, 0.5):
        best, again = refine(search, windows, search.own, None), False
    for seed in range(whole("starts", starts) - 1):
        if best.convincing or again or search.late():
            break
        with part(0.5, 0.9):
            other = refine(search, windows, *choose_start(search, windows, best.point.p, seed), best)
        again = other is best
        best = min(best, other, key=lambda end: end.unlikelihood)
    if not np.isfinite(best.unlikelihood):
        got, todo = "; ".join(log.notes) or None, "check signs, units and gains of the inputs, or fit fewer numbers"
        raise NumericalError("the equations diverge", got=got, todo=todo)
    problem, point, evidence, settled = best.problem, best.point, best.evidence, best.settled
    known = {path: float(point.p[k]) for k, path in enumerate(paths) if path in evidence.known}
    found = dict(zip(paths, point.p.tolist(), strict=False))
    reached = revise_scene(scene, found)
    made = place_uncertainty(reached, evidence, (low, high), paths)
    prediction = predict(reached, held, window)
    noise = np.where(np.isfinite(problem.readings).any(axis=(0, 1)), problem.sigma, np.nan)
    return Identification(
        made, known, evidence.errors, evidence.unknown, evidence.covariance, evidence.correlations, prediction.fit,
        dict(zip(prediction.fit, noise.tolist(), strict=True)),
        dict(zip(prediction.fit, evidence.colour.tolist(), strict=True)),
        prediction, settled,
        describe(best, prediction, hold_back, find_far(scene, found), (*name_unseen(problem, point.p), *log.notes)),
    )  # fmt: skip


def find_limits(scene: Scene, paths: list[str]) -> tuple[Array, Array]:
    """The ends of what the scene's schema takes: 0 where it refuses a negative number, 1 where it refuses 2, else none."""
    need_numbers(scene, paths)
    low, high = [], []
    large = {path: 1e3 * max(abs(get_value(scene, path)), 1.0) for path in paths}
    for path in paths:
        size = max(abs(get_value(scene, path)), 1e-3)
        low.append(-np.inf if accepts(scene, {path: -size}) else 0.0 if accepts(scene, {path: 0.0}) else 1e-6 * size)
        pairs = ({path: large[path], other: large[other]} for other in (path, *paths))  # one may bound the other
        high.append(np.inf if any(accepts(scene, pair) for pair in pairs) else 1.0)
    return np.array(low), np.array(high)


def accepts(scene: Scene, numbers: dict[str, float]) -> bool:
    """Whether a scene may have these numbers, and means the same joints: 0 among stiffnesses stands for a stiff one."""
    try:
        return free_joints(revise_scene(scene, numbers)) == free_joints(scene)
    except SceneError:
        return False


def free_joints(scene: Scene) -> list[tuple[bool, bool]]:
    """By effect and link, whether motor and bearing have coordinates of their own."""
    effects = effects_of(scene.effects)
    return [(one.frees_motor(i), one.frees_bearing(i)) for one in effects for i in range(len(scene.links))]


@dataclass(eq=False)
class Search:
    """What is sought by a log: numbers of a scene at paths, within limits; `late` says when no step is begun any more.

    `built`: the latest equations, for `shapes` of links.
    """

    scene: Scene
    log: Log
    paths: list[str]
    low: Array
    high: Array
    late: Callable[[], bool]
    shapes: bytes = field(default=b"", init=False)
    built: Logged | None = field(default=None, init=False)

    @property
    def own(self) -> Array:
        """The scene's own numbers."""
        return np.array([float(get_value(self.scene, path)) for path in self.paths])

    def model(self, values: Array) -> Logged:
        """The equations, with shapes of links for what these carry then; the same ones as before where the shapes are."""
        scene = revise_scene(self.scene, dict(zip(self.paths, values.tolist(), strict=True)))
        shapes = b"".join(one.tobytes() for one in sample_shapes(scene))
        if self.built is None or shapes != self.shapes:
            self.shapes, self.built = shapes, Logged.of(scene, self.log, self.paths)
        return self.built

    def pose(
        self, model: Logged, windows: Windows, values: Array, sigma: Array | None = None, finer: int = 1
    ) -> Problem:
        """The least-squares problem of these equations on a grid that is fine enough at these values, or finer."""
        shooting = prepare(model, windows, values, finer)
        readings = shooting.windows.readings()
        allows = lambda p: accepts(self.scene, dict(zip(self.paths, p.tolist(), strict=True)))  # noqa: E731
        scale = deviations(readings) if sigma is None else sigma
        return Problem(shooting, readings, scale, self.low, self.high, np.abs(self.own), allows)


def choose_start(search: Search, windows: Windows, values: Array, seed: int) -> tuple[Array, Array]:
    """Of the scene's values and some beside these those that meet heads of windows best, and from which starting states: no vibration
    slips by a cycle there."""
    rng = np.random.default_rng(seed)
    others = np.clip(values * np.exp(rng.normal(0, 0.5, (HEAD_STARTS, len(values)))), search.low, search.high)
    heads = windows.head(HEAD_SHARE * float((windows.ends - windows.starts).max()))
    problem = search.pose(search.model(values), heads, values)
    points = [solve(problem, meet_all(problem, one), HEAD_STEPS, late=search.late) for one in (search.own, *others)]
    best = min(points, key=lambda point: point.cost)
    return best.p, best.start


def meet_all(problem: Problem, values: Array) -> Point:
    """The starting states with which values meet each window."""
    return problem.at(find_starts(problem.shooting, START_SECONDS, values).start, values)


@dataclass(frozen=True, eq=False)
class End:
    """Where a search came to: the point, what is known there, and whether noise and numbers stayed before time or rounds ended.

    unsure: standard errors (n_p,), 0 where there are none; steep: numbers with which readings do not move as slopes say; passed: the
    numbers after each round.
    """

    problem: Problem
    point: Point
    evidence: Evidence
    unsure: Array
    settled: bool
    steep: tuple[str, ...]
    passed: tuple[Array, ...] = ()

    @property
    def unlikelihood(self) -> float:
        """sum_j N_j log |reading_j - h_j|, but for a constant of the log."""
        if not np.isfinite(self.point.cost):
            return np.inf
        seen, size = find_noise(self.problem, self.point)
        return float(seen @ np.log(size))

    @property
    def convincing(self) -> bool:
        """Whether nothing says that there may be a likelier one."""
        found = self.evidence
        return self.settled and not (found.coloured or found.limited or self.steep) and found.ahead <= BLOCKED_ERRORS


def find_noise(problem: Problem, point: Point, spent: Array | float = 0.0) -> tuple[Array, Array]:
    """The number of each output's readings, and their standard deviation about what is predicted.

    s_j^2 = |r_j|^2 / (N_j - spent_j), by restricted likelihood, which is s^2 = |r|^2 / (N - P) of one output.
    Source: Patterson, Thompson (1971), Recovery of inter-block information when block sizes are unequal, Biometrika 58, 545.
    """
    seen = np.count_nonzero(problem.weigh(np.ones_like(point.residual), point.p), axis=(0, 1))
    ratio = np.sum(point.residual**2, axis=(0, 1)) / np.maximum(seen - spent, 1)
    size = problem.sigma * np.sqrt(np.where(seen > 0, ratio, 1.0))
    return seen, np.maximum(size, 1e-9 * deviations(problem.readings))


def refine(search: Search, windows: Windows, values: Array, start: Array | None, rival: End | None = None) -> End:
    """The maximum of the likelihood from some values: noise and shapes of links are found anew until noise and numbers stay.

    They have to stay on steps of half the length too: the method's error is then small beside the stated ones. A search that comes to
    where a rival that has settled passed ends where that did.
    """
    model = search.model(values)
    problem = search.pose(model, windows, values)
    point = meet_all(problem, values) if start is None else problem.at(start, values)
    steps, unsure = FIRST_STEPS, np.zeros(len(values))
    evidence, settled, stays, finer = leave_unknown(problem, point, search.paths), False, False, 1
    passed: tuple[Array, ...] = ()
    for k in range(ROUNDS):
        values = point.p
        with part(k / ROUNDS, (k + 1) / ROUNDS):
            point = solve(problem, point, steps, 1e-6 if k else FIRST_GAIN, search.late)
        if not np.isfinite(point.costs).all():
            break
        if rival and rival.settled and any(are_still(point.p, one, rival.unsure) for one in rival.passed):
            return rival
        passed = (*passed, point.p)
        evidence = weigh_evidence(problem, point, search.paths)
        _, size = find_noise(problem, point, evidence.spent)
        found = np.array([evidence.errors.get(path, np.nan) for path in search.paths])
        unsure = np.where(np.isfinite(found), found, unsure)  # at or near a limit: what it was inside
        known = bool(np.all(np.abs(size / problem.sigma - 1) < SETTLED_NOISE))
        halved, stays = stays, k > 0 and known and are_still(point.p, values, unsure)
        settled = stays and halved
        if settled or search.late():
            break
        finer *= 1 + stays
        before, model = model, search.model(point.p)
        steps = STEPS if model is before else NEW_STEPS
        damping = min(point.damping, FREED_DAMPING)
        posed = search.pose(model, windows, point.p, size, finer)
        if model is before and posed.shooting.windows.h == problem.shooting.windows.h:
            problem, point = problem.reweighed(point, size)
        else:
            problem, point = posed, posed.at(point.start, point.p)
        point.damping = damping
    if not settled:
        return End(problem, point, leave_unknown(problem, point, search.paths), unsure, False, ())
    steep = find_steep(problem, point, evidence, search.paths)
    if steep:
        none = leave_unknown(problem, point, list(evidence.known))
        evidence = replace(evidence, errors=none.errors, covariance=none.covariance, correlations={}, ahead=0.0)
    return End(problem, point, evidence, unsure, True, steep, passed)


def are_still(p: Array, before: Array, unsure: Array) -> bool:
    """Whether numbers are what they were, by their standard errors, or a thousandth of them where there are none."""
    return bool(np.all(np.abs(p - before) <= np.where(unsure > 0, STILL_ERRORS * unsure, 1e-3 * np.abs(before))))


def find_steep(problem: Problem, point: Point, evidence: Evidence, paths: list[str]) -> tuple[str, ...]:
    """Numbers with which readings move by far less than slopes say, as where friction is sharper than steps: errors would be too small."""
    lengths, found = np.linalg.norm(problem.slopes(point)[:, :, point.start.shape[1] :], axis=(0, 1)), list[str]()
    for k, path in enumerate(paths):
        if np.isfinite(evidence.errors.get(path, np.nan)) and lengths[k] > 0:
            step = np.zeros_like(point.p)
            step[k] = 1 / lengths[k]
            ahead, behind = (problem.at(point.start, point.p + way * step).residual for way in (1, -1))
            with np.errstate(invalid="ignore"):  # beyond a bound both are infinite
                found += [path] * bool(np.linalg.norm(ahead - behind) < 2 / SAFETY)
    return tuple(found)


def sample_shapes(scene: Scene) -> list[Array]:
    """The shapes of a scene's links, which the masses that these carry may change, at some places."""
    flexible = [(k, d) for k, link in enumerate(scene.links) for d in DIRECTIONS if getattr(link.counts, d)]
    return [make_shapes(scene, k, direction).values(np.linspace(0, 1, 9), 0) for k, direction in flexible]


def place_uncertainty(scene: Scene, evidence: Evidence, limits: tuple[Array, Array], paths: list[str]) -> Scene:
    """The scene with two standard errors to both sides of each number of the arm as its [uncertainty]."""
    table: dict[str, dict[str, float]] = {}
    for path, error in list(evidence.errors.items()):
        k, value = paths.index(path), float(get_value(scene, path))
        ends = max(value - 2 * error, float(limits[0][k])), min(value + 2 * error, float(limits[1][k]))
        if ends[0] < ends[1] and not path.startswith(("log.", "uncertainty.")) and len(table) < MOST_UNCERTAIN:
            table[path] = {"low": ends[0], "high": ends[1]}
    return parse_scene(raw_tables(scene), scene.title, {"uncertainty": table}) if table else scene


def find_far(scene: Scene, found: dict[str, float]) -> list[str]:
    """The numbers that are more than ten times what the scene had, or less than a tenth."""
    before = {path: float(get_value(scene, path)) for path in found if not path.startswith("log.")}
    sizes = {path: sorted((abs(value), abs(found[path]))) for path, value in before.items()}
    return [path for path, (small, large) in sizes.items() if large > FAR_FACTOR * small > 0]


def name_unseen(problem: Problem, p: Array) -> list[str]:
    """A vibration that samples take for a slower one: free starting states then make noise into evidence."""
    fastest = np.abs(problem.shooting.rates(p).imag).max() / (2 * np.pi)
    rate = 1 / problem.shooting.windows.log.step
    if fastest <= 0.5 * rate:
        return []
    said = f"a vibration of {fastest:.3g} Hz is faster than half of the log's {rate:.3g} samples a second"
    return [f"{said}, so errors may be larger than stated: take fewer modes, or log faster"]


def describe(end: End, prediction: Prediction, hold_back: float, far: list[str], notes: Iterable[str]) -> str:
    """What was found, and what to do."""
    evidence, settled = end.evidence, end.settled
    unsettled = (
        "time or rounds ended before the search had settled, so errors are not known: allow more, or begin elsewhere"
    )
    said = [] if settled else [unsettled]
    if end.steep:
        names = ", ".join(end.steep) if len(end.steep) < len(evidence.known) else "any number"
        said.append(
            f"readings do not move with {names} as slopes say, as where friction is sharper than steps, so no errors are known: give it "
            "a larger rate, and keep that fixed"
        )
    for group in evidence.unknown:
        names = " and ".join(group)
        if len(group) == 1:
            said.append(f"{names} cannot be known from this log: excite what depends on it, or keep it fixed")
        else:
            said.append(f"{names} cannot be parted by this log: vary what changes one of them alone, or keep one fixed")
    if evidence.limited:
        said.append(f"{', '.join(evidence.limited)} went to the end of what is possible: the effect may not be there")
    if evidence.coloured:
        said.append("residuals are coloured: the errors allow for coloured noise, but not for what the equations lack")
    if evidence.ahead > BLOCKED_ERRORS:
        said.append(
            "the search ends where no step gains, as it may where joints stick, though slopes promise one of "
            f"{evidence.ahead:.1f} standard errors: errors are larger than stated; fit fewer numbers, or begin elsewhere"
        )
    if far and (evidence.coloured or not settled):
        said.append(f"{', '.join(far)} went far from the scene's: check signs, units and gains of the log's columns")
    missed = name_missed(prediction.fit, prediction.measured, prediction.outputs)
    if missed:
        said.append(
            f"less than half is predicted of {', '.join(missed)}: check sign and unit, or try other effects, delays or filters"
        )
    kept = "the last part of the log, which was not fitted" if hold_back else "what was fitted"
    return "; ".join([*(said or ["all numbers are known"]), f"the fit is over {kept}", *notes])
