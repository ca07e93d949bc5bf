"""Which effects a measured log calls for: added one at a time while the part that was kept back is predicted better than chance."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.special import ndtr, stdtr

from flexlin.analyses.audit.versions import Version, list_effect_versions, with_effect
from flexlin.arguments import checked
from flexlin.bounds import hint_at
from flexlin.checks import Array
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.identification.log import Log
from flexlin.identification.maximum_likelihood import Identification, identify
from flexlin.identification.prediction import Prediction
from flexlin.plots.view import Shown, View
from flexlin.precision import PARTIAL, SLIGHT, TINY
from flexlin.resources import Stopwatch, part
from flexlin.scene.effects import known_effects
from flexlin.scene.loading import revise_scene
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

CHANCE = 0.05
"""Probability that of all effects in question one that is not there is taken in a round."""
BLOCKS = 4
"""Of a window: neighbouring errors go together, sums over blocks much less."""
LEAST_BLOCKS = 5
"""From which on anything is said of chance."""
FIRST_SHARE = 0.3
"""Of the time, for the numbers without any further effect."""
LATE = "the time was used up: allow more, or name fewer effects"


@immutable
class EffectTrial:
    """What an effect adds to the prediction of the part of a log that was kept back.

    Attributes
    ----------
    effect : str
        Its name.
    after : tuple of str
        The effects that were taken before.
    gain : float
        Share of the squared errors that goes with the effect, in geometric mean; not a number where it was not judged.
    chance : float
        Probability of so consistent a gain by chance, of one effect that is not there.
    t_ratio : float
        The largest of its numbers over their standard errors in what was fitted; not a number where none is known.
    taken : bool
        Whether it was added.
    problem : str
        Why it was not judged.

    Examples
    --------
    >>> from flexlin.analyses.log_effects import EffectTrial
    >>> EffectTrial("shear", (), 0.001, 0.4).taken
    False
    """

    effect: str
    after: tuple[str, ...]
    gain: float = np.nan
    chance: float = 1.0
    t_ratio: float = np.nan
    taken: bool = False
    problem: str = ""

    def __str__(self) -> str:
        beside = f"beside {', '.join(self.after)}, " if self.after else ""
        if self.problem:
            return f"{beside}{self.effect}: not judged, {self.problem}"
        change = f"{abs(100 * self.gain):.3g} % {'less' if self.gain > 0 else 'more'} squared error, by chance {self.chance:.1g}"
        change += f", its numbers {self.t_ratio:.3g} standard errors from zero" if np.isfinite(self.t_ratio) else ""
        change = change if abs(self.gain) > SLIGHT else "changes nothing"
        return f"{beside}{self.effect}: {change}{', taken' * self.taken}"


@immutable(eq=False)
class EffectSelection(Shown):
    """The effects that a log calls for, and the numbers with them.

    Attributes
    ----------
    identification : Identification
        The numbers with all effects that were taken, and the scene with these.
    trials : tuple of EffectTrial
        What was tried, in the order of trial.
    effects : tuple of str
        The effects that were taken, in the order of what they gain.
    status : str
        What the log calls for, what it does not need, and what to do.

    Examples
    --------
    >>> from dataclasses import fields
    >>> from flexlin.analyses.log_effects import EffectSelection
    >>> [field.name for field in fields(EffectSelection)][:2]
    ['identification', 'trials']
    """

    identification: Identification
    trials: tuple[EffectTrial, ...]
    effects: tuple[str, ...]
    status: str

    def to_xarray(self) -> Any:
        """Return gains and chances as a dataset.

        Returns
        -------
        xarray.Dataset
            By trial, beside what the identification gives.
        """
        import xarray

        judged = ("gain", "chance", "t_ratio", "taken")
        columns = {name: ("trial", [getattr(one, name) for one in self.trials]) for name in judged}
        names = [one.effect for one in self.trials]
        return self.identification.to_xarray().merge(xarray.Dataset(columns, coords={"effect": ("trial", names)}))

    def _view(self) -> View:
        view = self.identification._view()
        return replace(view, title="effects of a log", facts=(*view.facts, *map(str, self.trials), self.status))


@checked
def select_effects(
    scene: Scene,
    log: Log,
    free: Iterable[str],
    effects: Iterable[str] | None = None,
    window: float = 2.0,
    hold_back: float = 1 / 3,
    seconds: float | None = None,
) -> EffectSelection:
    """Find which effects a log calls for, by forward selection.

        gain = 1 - exp mean log ( |reading - h with the effect|^2 / |reading - h without|^2 )

    The mean is over columns, and over quarters of the windows of what was kept back. An effect is added with figures that its own file
    proposes, and its numbers are fitted beside those that are free. It is taken where it gains most of all, a thousandth at least, and
    better than chance: its numbers are so many standard errors from zero, at a level that all effects in question share, and what was kept
    back confirms it, by Student's test over the quarters at the root of that level, or at the level itself where no errors are known.
    Then the others are tried once more beside it, and what was taken before goes if it gains nothing any more.
    Effects whose size nobody can propose (payload, hub, forces) are not tried: give them in the scene.

    Parameters
    ----------
    scene : Scene
        The arm without the effects in question; its numbers are where the search begins.
    log : Log
        What was measured.
    free : iterable of str
        Dotted paths of numbers to find in any case.
    effects : iterable of str, optional
        Names of effects to try; all that the scene lacks where it is left out.
    window : float
        Length of a window, in s.
    hold_back : float
        Share of the log, at its end, that is predicted and judges.
    seconds : float, optional
        Time after which no effect is tried any more, by default as long as it takes.

    Returns
    -------
    EffectSelection
        Numbers with the effects that were taken, and what each trial gained.

    Raises
    ------
    ArgumentError
        When there is no such effect, the scene has it, or too little is kept back.
    NumericalError
        When the equations diverge without any further effect.

    References
    ----------
    Ljung, System Identification (1999), 16.5 (model validation on fresh data); Billings, Nonlinear System Identification (2013), 3 (forward
    selection).

    Examples
    --------
    A log of an arm at rest calls for nothing:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 0, "effects.gravity": "off", "designs": []})
    >>> t = np.arange(300) * 0.01
    >>> log = fl.Log(t, inputs={"q1": 0 * t}, outputs={"q1": 1e-3 * np.sin(900 * t**2)})
    >>> fl.select_effects(scene, log, ["effects.payload.mass"], ["viscous_friction"], window=0.5).effects
    ()
    """
    paths, kept = list(free), hold_back * float(log.time[-1] - log.time[0])
    if not (0 < hold_back < 0.9 and BLOCKS * kept >= LEAST_BLOCKS * window):
        least = f"at least {LEAST_BLOCKS / BLOCKS:g} windows, and less than 0.9 of the log"
        raise ArgumentError("too little of the log is kept back", got=f"{kept:.3g} s", expected=least)
    versions, trials, taken = choose_versions(scene, effects), list[EffectTrial](), list[str]()
    level = CHANCE / max(len(versions), 1)
    fits = Fits(
        partial(identify, log=log, window=window, hold_back=hold_back), paths, seconds, 1 / (3 + 2 * len(versions))
    )
    best = fits.run(scene, [], FIRST_SHARE)
    while True:
        if fits.are_late:
            trials += [EffectTrial(name, tuple(taken), problem=LATE) for name in versions]
            break
        numbers = list_numbers(taken, scene)
        scene = fits.take_over(scene, numbers, best)
        further = fits.run(scene, numbers, PARTIAL, starts=1)
        loss, is_sure = compare(further.prediction, best.prediction), np.isfinite(list(further.errors.values())).any()
        if is_sure and not is_gain(*loss, level):  # no effect is credited with what more steps gain
            best, scene = further, fits.take_over(scene, numbers, further)
        found = {name: fits.add(name, versions[name].make(scene), taken, best) for name in versions}
        likely = [trial for trial, tried in found.values() if tried and is_likely(trial, level)]
        chosen = max(likely, key=lambda trial: trial.gain).effect if likely else None
        trials += [replace(trial, taken=trial.effect == chosen) for trial, _ in found.values()]
        if chosen is None:
            break
        best, taken = found[chosen][1] or best, [*taken, chosen]
        scene = versions.pop(chosen).make(scene)
        scene = fits.take_over(scene, list_numbers(taken, scene), best)
        for name in taken[:-1]:
            rest, without = [other for other in taken if other != name], with_effect(scene, name, None)
            trial, tried = fits.leave_out(name, without, rest, best)
            trials.append(trial)
            if tried and not is_likely(trial, level):  # what came later does its work
                scene, best, taken = without, tried, rest
    return EffectSelection(best, tuple(trials), tuple(taken), describe(trials, taken))


@dataclass
class Fits:
    """Fits of a log, which share the time among them; `identify`: of a scene; `free`: paths of numbers besides those of effects.

    next_part: of the work that is left, what a fit takes, as progress says: how many effects follow is not known.
    """

    identify: Callable[..., Identification]
    free: list[str]
    seconds: float | None
    next_part: float
    watch: Stopwatch = field(default_factory=Stopwatch)
    begun: int = 0

    @property
    def left(self) -> float:
        """Seconds by the clock."""
        return np.inf if self.seconds is None else self.seconds - self.watch.clock

    @property
    def are_late(self) -> bool:
        """Whether none is begun any more."""
        return self.left <= 0

    def run(self, scene: Scene, more: list[str], share: float, **how: int) -> Identification:
        """The numbers, and more of them, in a share of the time that is left."""
        paths = [*self.free, *more]
        ahead, self.begun = (1 - self.next_part) ** self.begun, self.begun + 1
        with part(1 - ahead, 1 - (1 - self.next_part) * ahead):
            seconds = None if self.seconds is None else max(share * self.left, TINY)
            return self.identify(scene, free=paths, seconds=seconds, **how)

    def take_over(self, scene: Scene, more: list[str], found: Identification) -> Scene:
        """The scene with all numbers as they were found."""
        return revise_scene(scene, {path: float(get_value(found.scene, path)) for path in (*self.free, *more)})

    def add(
        self, name: str, made: Scene, taken: list[str], before: Identification
    ) -> tuple[EffectTrial, Identification | None]:
        """What an effect gains beside those taken, and the numbers of the scene with it; none where the log does not know its own.

        At first those that the effect cannot be without are fitted, then all, which counts where it gives errors: others are too far off to
        begin with.
        """
        trial, tried, others = EffectTrial(name, tuple(taken)), None, list_numbers(taken, made)
        own, every = (list_numbers([name], made, required) for required in (True, False))
        try:
            for numbers in [own, every][: 1 + (every != own)]:
                if self.are_late:
                    return replace(trial, problem=LATE), None
                made = self.take_over(made, [*others, *own], tried) if tried else revise_scene(made, {})
                found = self.run(made, [*others, *numbers], PARTIAL, starts=1)
                tried = found if tried is None or np.isfinite(list(found.errors.values())).any() else tried
        except FlexlinError as error:
            return replace(trial, problem=" ".join(str(error).split())), None
        assert tried is not None
        return judge(trial, before, tried), None if own and not tried.values.keys() & own else tried

    def leave_out(
        self, name: str, made: Scene, rest: list[str], before: Identification
    ) -> tuple[EffectTrial, Identification | None]:
        """What an effect that was taken gains beside the rest, and the numbers of the scene without it."""
        trial = EffectTrial(name, tuple(rest))
        if self.are_late:
            return replace(trial, problem=LATE), None
        try:
            tried = self.run(made, list_numbers(rest, made), PARTIAL, starts=1)
        except FlexlinError as error:
            return replace(trial, problem=" ".join(str(error).split())), None
        return judge(trial, tried, before), tried


def choose_versions(scene: Scene, effects: Iterable[str] | None) -> dict[str, Version]:
    """The scene with each effect in question by its name. Raises: ArgumentError."""
    possible = {one.subject: one for one in list_effect_versions(scene) if not one.on}
    possible = {name: one for name, one in possible.items() if not getattr(known_effects()[name], "input_unit", None)}
    names = list(possible) if effects is None else list(dict.fromkeys(effects))
    for name in names:
        if name not in possible:
            what = "the scene has this effect" if name in scene.effects.on() else "this effect cannot be tried"
            raise ArgumentError(what, got=name, expected=f"some of {', '.join(possible)}{hint_at(name, possible)}")
    return {name: possible[name] for name in names}


def list_numbers(effects: Iterable[str], scene: Scene, required: bool = False) -> list[str]:
    """The paths of the numbers that stand in the effects' tables and are not zero; required: of those alone without which none is."""

    def walk(value: Any, path: str) -> Iterator[str]:
        if isinstance(value, tuple):
            for i, one in enumerate(value):
                yield from walk(one, f"{path}.{i}")
        elif isinstance(value, float) and value != 0.0:
            yield path

    found = list[str]()
    for name in effects:
        table = getattr(scene.effects, name)
        for key, value in table.model_dump(exclude_unset=True).items():
            if not required or type(table).model_fields[key].is_required():
                found += walk(value, f"effects.{name}.{key}")
    return found


def judge(trial: EffectTrial, without: Identification, found: Identification) -> EffectTrial:
    """What the effect of a trial gains, and how far the numbers that it cannot be without are from zero."""
    gain, chance = compare(without.prediction, found.prediction)
    errors = {path: found.errors.get(path, np.nan) for path in list_numbers([trial.effect], found.scene, required=True)}
    ratios = [abs(found.values[path]) / max(error, TINY) for path, error in errors.items() if np.isfinite(error)]
    return replace(trial, gain=gain, chance=chance, t_ratio=max(ratios, default=np.nan))


def compare(before: Prediction, after: Prediction) -> tuple[float, float]:
    """The gain, and the probability of so consistent a one by chance, from ratios of squared errors over quarters of windows."""
    if not np.array_equal(before.time, after.time):
        return -np.inf, 1.0  # some window diverges
    ratios = np.log(sum_blocks(before) / sum_blocks(after)).mean(axis=0)
    spread = max(float(ratios.std(ddof=1)), TINY)
    chance = stdtr(len(ratios) - 1, -ratios.mean() / spread * np.sqrt(len(ratios)))
    return float(-np.expm1(-ratios.mean())), float(chance)


def is_likely(trial: EffectTrial, level: float) -> bool:
    """Whether its numbers are not zero by chance, and what was kept back confirms it; that alone decides where no errors are known.

    It is the weaker test: neighbouring quarters of a window share the error of its starting state, which numbers do not.
    """
    if not np.isfinite(trial.t_ratio):
        return is_gain(trial.gain, trial.chance, level)
    return 2 * ndtr(-trial.t_ratio) < level and is_gain(trial.gain, trial.chance, np.sqrt(level))


def is_gain(gain: float, chance: float, level: float) -> bool:
    """Whether there is a gain, and by chance less probably than that."""
    return gain > SLIGHT and chance < level


def sum_blocks(found: Prediction) -> Array:
    """The squared errors of each column, summed over each quarter of a window, (columns, blocks)."""
    window = np.searchsorted(found.starts, found.time, side="right") - 1
    since = found.time - found.starts[window]
    block = BLOCKS * window + np.minimum(BLOCKS * since / max(float(since.max()), TINY), BLOCKS - 1).astype(int)
    errors = np.array([found.measured[name] - found.outputs[name] for name in found.outputs])
    sums = [np.bincount(block, np.nan_to_num(one) ** 2)[np.unique(block)] for one in errors]
    return np.array(sums) + TINY


def describe(trials: list[EffectTrial], taken: list[str]) -> str:
    """What the log calls for, what it does not need, and what to do."""
    gains = {one.effect: one.gain for one in trials if one.taken}
    judged = dict.fromkeys(one.effect for one in trials if not one.problem and one.effect not in taken)
    shares = ", ".join(f"{name} ({100 * gains[name]:.3g} % less squared error)" for name in taken)
    nothing = "the log calls for no further effect" if judged else "no effect was judged"
    said = [f"the log calls for {shares}" if taken else nothing]
    if judged:
        said.append(f"not needed: {', '.join(judged)}")
    others = dict.fromkeys(one.effect for one in trials if one.problem and one.effect not in (*taken, *judged))
    if others:
        said.append(f"not judged: {', '.join(others)}; see why beside each")
    return "; ".join(said)
