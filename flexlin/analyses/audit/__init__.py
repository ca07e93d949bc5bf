"""Which effects and how many modes a scene needs: each switched in turn and in pairs, what changes, and what it costs."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import combinations
from typing import Any

import numpy as np

from flexlin.analyses.audit import versions
from flexlin.analyses.audit.versions import Measure, Part, Version, join_parts, list_mode_versions, measure
from flexlin.analyses.clock import Progress
from flexlin.analyses.judging import SMALL_SHARE, arm_length
from flexlin.arguments import checked
from flexlin.checks import positive, try_to
from flexlin.control.drives import Demand
from flexlin.errors import TimeLimit
from flexlin.lazy import lazy
from flexlin.linearization.linear import linearize
from flexlin.mechanics import build_manipulator
from flexlin.resources import advance, part
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

__all__ = ["Audit", "Measure", "Minimal", "Row", "audit", "measure"]


@immutable
class Row:
    """One change of a scene and what came of it. Differences are version minus scene.

    Attributes
    ----------
    change : str
        What was done.
    kind : {"effect", "modes"}
        What was changed.
    subject : str
        The effect's name or the link's key.
    on : bool
        Whether the scene has it.
    table : dict
        The effect's figures in the version that has it.
    margin : float
        Difference of the largest growth rates, in 1/s.
    frequency : float
        Largest relative change of the slower half of the frequencies.
    tip_error : float
        Difference of the tip errors, in m.
    instructions : int
        Difference of the instructions of all coefficients.
    microseconds : float
        Difference of the times to evaluate them once, in microseconds.
    coordinates : int
        Difference of the numbers of coordinates.
    verdict : str
        Verdict on the version.
    significance : float
        Largest of the relative changes: of margin, frequencies, tip path and torques; infinite where the verdict or a drive's mark changes.
    advice : str
        What to do at the audit's tolerance.
    problem : str
        Why the version could not be judged.
    units : dict
        Units of the figures in `table`.
    path : float
        Largest distance of the two tip paths, relative to how far the tip moves.
    torque : float
        Largest relative change of a joint's peak or RMS torque.
    marks : tuple of str
        Limits of the drives that one of the two exceeds and the other does not.
    unfelt : tuple of str
        Coordinates of one of the two alone that neither motors nor motion reach; they change nothing.

    Examples
    --------
    >>> from flexlin.analyses.audit import Row
    >>> row = Row("shear off", "effect", "shear", True, {}, 0.0, 1e-5, 0.0, 0, 0.0, 0, "stable", 1e-5, "may be dropped")
    >>> row.judged
    True
    """

    change: str
    kind: str
    subject: str
    on: bool
    table: dict[str, Any]
    margin: float
    frequency: float
    tip_error: float
    instructions: int
    microseconds: float
    coordinates: int
    verdict: str
    significance: float
    advice: str
    problem: str = ""
    units: dict[str, str] = field(default_factory=dict)
    path: float = 0.0
    torque: float = 0.0
    marks: tuple[str, ...] = ()
    unfelt: tuple[str, ...] = ()

    @property
    def judged(self) -> bool:
        """Whether all figures are known: without them nothing can be called needless."""
        return bool(np.isfinite([self.margin, self.path, self.torque]).all())


@immutable
class Minimal:
    """The smallest scene that was found, and how far it is from the scene with modes enough.

    Attributes
    ----------
    scene : Scene
        The scene, without designs whose lists of weights no longer fit.
    error : Row
        What it changes, all at once: its `significance` is the error that it makes.
    dropped : tuple of str
        The changes that made it smaller.
    added : tuple of str
        The changes that made it larger: modes that the scene lacked.
    coordinates : int
        Its number of coordinates.

    Examples
    --------
    >>> import flexlin as fl
    >>> changes = {"links.0.modes": 0, "links.0.bending_stiffness": None, "designs": []}
    >>> found = fl.audit(fl.load_scene("single-link", changes)).minimal
    >>> found.error.significance <= 0.01, found.coordinates
    (True, 1)
    """

    scene: Scene
    error: Row
    dropped: tuple[str, ...]
    added: tuple[str, ...]
    coordinates: int


@immutable
class Audit:
    """What a scene needs.

    Attributes
    ----------
    base : Measure
        The scene's own figures.
    effects : tuple of Row
        One row for each effect switched, the most significant first.
    modes : tuple of Row
        One row for each change of a link's modes.
    tolerance : float
        Relative change that matters.
    pairs : tuple of Row
        Pairs of effects that are noticed only together, or cancel.
    minimal : Minimal or None
        The smallest scene that was found to be enough; None where the scene itself has no margin to compare with.
    problem : str
        Why pairs or the minimal scene are missing.

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.analyses.audit import Audit, Measure, Row
    >>> base = Measure(-1.0, 1e-9, "stable", np.array([5.0]), 0.01, 3, 100, 2.0)
    >>> row = Row("shear off", "effect", "shear", True, {}, 0.0, 1e-5, 0.0, 0, 0.0, 0, "stable", 1e-5, "may be dropped")
    >>> Audit(base, (row,), (), 0.01).droppable
    ('shear',)
    """

    base: Measure
    effects: tuple[Row, ...]
    modes: tuple[Row, ...]
    tolerance: float
    pairs: tuple[Row, ...] = ()
    minimal: Minimal | None = None
    problem: str = ""

    @property
    def needed(self) -> tuple[str, ...]:
        """Effects of the scene that it cannot do without at this tolerance."""
        return tuple(row.subject for row in self.effects if row.on and row.significance > self.tolerance)

    @property
    def droppable(self) -> tuple[str, ...]:
        """Effects of the scene whose absence would not be noticed at this tolerance."""
        return tuple(
            row.subject for row in self.effects if row.on and row.judged and row.significance <= self.tolerance
        )

    @property
    def missing(self) -> tuple[str, ...]:
        """Effects that the scene leaves out and that would be noticed with the stated figures."""
        return tuple(row.subject for row in self.effects if not row.on and row.significance > self.tolerance)


GROWN = ("tip_error", "instructions", "microseconds", "coordinates")
"""Figures whose differences a row states."""
NEGLIGIBLE_SHARE = 1e-6
"""A torque, or a motion of the tip, that is nothing beside the largest of all joints, or beside the arm."""


@dataclass(frozen=True)
class Judge:
    """Compares versions with a scene; tolerance: the relative change that matters; tol: wanted error of the exponents.

    report: called with the description of each version before it is measured.
    """

    scene: Scene
    tolerance: float
    tol: float
    report: Progress = lambda _: None

    @lazy
    def base(self) -> Measure:
        """The scene's own figures."""
        return measure(self.scene, self.tol)

    @lazy
    def reach(self) -> float:
        """The arm's length, in m."""
        return find_reach(self.scene)

    def row(self, version: Version, scene: Scene | None = None) -> Row:
        """What a version changes; or what another scene does that was made of several."""
        head, nan = (version.change, version.kind, version.subject, version.on, version.table), float("nan")
        other = try_to(lambda: measure(version.make(self.scene) if scene is None else scene, self.tol))
        if isinstance(other, Exception):
            tried = version.kind == "effect" and not version.on
            left_out = "left out, because the scene does not bear the figures it would be tried with: " if tried else ""
            unknown = (*head, nan, nan, nan, 0, nan, 0, "unknown", nan, "see the problem")
            return Row(*unknown, left_out + str(other), version.units)
        base = self.base
        own, theirs, unfelt = share_parts(base, other)
        path, torque, marks = self.compare_paths(other), compare_torques(base, other), changed_marks(base, other)
        margin, frequency = theirs.margin - own.margin, compare_frequencies(own, theirs)
        size = float(np.nanmax([compare_margins(own, theirs), frequency, path, torque]))
        if marks or ("unknown" not in (own.verdict, theirs.verdict) and own.verdict != theirs.verdict):
            size = float("inf")
        found: dict[str, Any] = {name: getattr(other, name) - getattr(base, name) for name in GROWN}
        found |= {"path": path, "torque": torque, "marks": marks, "unfelt": unfelt, "units": version.units}
        found |= {"verdict": theirs.verdict, "significance": size, "problem": "; ".join(other.problems)}
        row = Row(*head, margin, frequency, advice="", **found)
        broken = max(other.tip_error, base.tip_error) > SMALL_SHARE * self.reach
        return replace(row, advice=advise(row, size > self.tolerance, broken))

    def compare_paths(self, other: Measure) -> float:
        """The largest distance of the two tip paths, relative to how far the tip moves, or to the arm where it rests; 0 without points."""
        first, second = self.base.path, other.path
        if first is None or second is None:
            return float("nan")
        moves = float(np.linalg.norm(first - first.mean(axis=0), axis=1).max())
        size = moves if moves > NEGLIGIBLE_SHARE * self.reach else self.reach
        return float(np.linalg.norm(second - first, axis=1).max() / size)


def share_parts(base: Measure, other: Measure) -> tuple[Part, Part, tuple[str, ...]]:
    """What counts of both, and the coordinates that do not.

    These are coordinates of one of the two alone that neither motors nor motion reach, unless they grow by themselves.
    """
    shared = set.intersection(*({name for part in m.parts for name in part.names} for m in (base, other)))

    def counts(part: Part) -> bool:
        return part.felt or part.verdict == "unstable" or not shared.isdisjoint(part.names)

    own, theirs = (join_parts(tuple(filter(counts, m.parts))) for m in (base, other))
    unfelt = [name for m in (base, other) for part in m.parts if not counts(part) for name in part.names]
    return own, theirs, tuple(unfelt)


def compare_torques(base: Measure, other: Measure) -> float:
    """The largest relative change of a joint's peak or RMS torque; what is nothing beside the largest torque of all joints is left out."""
    if base.demands is None or other.demands is None:
        return float("nan")
    pairs = [(a, b) for a, b in pair_demands(base, other) if a.what in ("peak torque", "RMS torque")]
    largest = {
        unit: max(max(a.value, b.value) for a, b in pairs if a.unit == unit) for unit in {a.unit for a, _ in pairs}
    }
    known = [(a.value, b.value) for a, b in pairs if max(a.value, b.value) > NEGLIGIBLE_SHARE * largest[a.unit]]
    return max((abs(a - b) / max(a, b) for a, b in known), default=0.0)


def changed_marks(base: Measure, other: Measure) -> tuple[str, ...]:
    """The limits of the drives that one of the two exceeds and the other does not."""
    return tuple(f"{a.what} of {a.joint}" for a, b in pair_demands(base, other) if a.exceeds != b.exceeds)


def pair_demands(base: Measure, other: Measure) -> list[tuple[Demand, Demand]]:
    """What both ask of the drives, drive by drive: a motor behind a spring bears another name than its joint."""
    kinds = {demand.what: None for demand in base.demands or ()}
    one, two = ([[d for d in m.demands or () if d.what == what] for what in kinds] for m in (base, other))
    return [pair for first, second in zip(one, two, strict=True) for pair in zip(first, second, strict=False)]


def compare_frequencies(base: Part, other: Part) -> float:
    """The largest relative change of the slower half of the frequencies that both have: the last modes of a basis are never accurate."""
    count = (min(len(base.frequencies), len(other.frequencies)) + 1) // 2
    first, second = base.frequencies[:count], other.frequencies[:count]
    scale = np.maximum(np.maximum(first, second), 1e-9)
    return float(np.max(np.abs(first - second) / scale, initial=0.0))


def compare_margins(base: Part, other: Part) -> float:
    """The change of the margin against the larger of the two; 0 within their errors or where one is unknown."""
    change = abs(other.margin - base.margin)
    if not change > base.error + other.error:
        return 0.0
    return change / max(abs(base.margin), abs(other.margin))


def advise(row: Row, matters: bool, broken: bool) -> str:
    """What to do; `broken`: the tip is so far off in one of the two that the linear model holds for it no longer."""
    if not (matters or row.judged):
        return "undecided: not all of it could be judged"
    note = f"; neither motors nor motion reach {', '.join(row.unfelt)}" if row.unfelt else ""
    if row.kind == "modes":
        if row.on:
            return "its last mode is needed" if matters else f"a mode less is enough{note}"
        return "another mode would be noticed" if matters else f"its modes are enough{note}"
    if row.on:
        return "keep" if matters else f"may be dropped{note}"
    if matters and broken:
        return "with these figures the deflections are not small: it would be noticed, but this is no prediction of how much"
    return "consider it: with these figures it would be noticed" if matters else f"not needed with these figures{note}"


NOTHING = Version(lambda scene: scene, "the minimal scene", "minimal", "scene", True, {})
"""The change that is none."""


def shrink(judge: Judge, tried: Sequence[tuple[Version, Row]], pairs: Sequence[Row]) -> Minimal:
    """Give links the modes that they lack, then drop effects and modes one after the other, as long as all of it stays unnoticed.

    Changes that are not noticed alone are tried, the least significant first, and pairs that cancel. Every step is compared with
    the scene that has modes enough, so errors add up under the same tolerance. Greedy: what is left is
    needed, but another order may leave less.
    """
    judge, added = grow(judge)
    row, dropped, scene = judge.row(NOTHING), list[str](), judge.scene
    cancelling = [set(row.subject.split(" and ")) for row in pairs if row.on and row.significance <= judge.tolerance]
    paired = set[str]().union(*cancelling)
    known = [(version, alone) for version, alone in tried if version.on and alone.judged]
    known = [one for one in known if one[1].significance <= judge.tolerance or one[0].subject in paired]
    candidates = [version for version, _ in sorted(known, key=lambda one: one[1].significance)]
    done = 0
    while candidates:
        version = candidates.pop(0)
        done += 1
        partners = [other for other in candidates if {version.subject, other.subject} in cancelling]
        for changes in ([version], *([version, partner] for partner in partners)):
            trial = reduce(lambda made, change: change.make(made), changes, scene)
            judge.report(f"minimal scene: {version.change}")
            advance(done / (done + len(candidates) + 1))
            found = judge.row(NOTHING, trial)
            if found.judged and found.significance <= judge.tolerance:
                row, scene = found, trial
                dropped += [change.change for change in changes]
                candidates = [other for other in candidates if other not in changes]
                if version.kind == "modes":
                    candidates = again(scene, version) + candidates
                break
    return Minimal(scene, row, tuple(dropped), added, judge.base.coordinates + row.coordinates)


def grow(judge: Judge) -> tuple[Judge, tuple[str, ...]]:
    """Compare from here on with a scene whose links have modes enough, at most two more: another in each would not be noticed."""
    added = []
    for _ in range(2):
        before = judge
        for version in list_mode_versions(judge.scene):
            if version.on:
                continue
            judge.report(f"minimal scene: {version.change}")
            row = before.row(version)
            if row.significance > judge.tolerance and row.judged:
                judge = replace(judge, scene=version.make(judge.scene))
                added.append(version.change)
        if judge is before:
            break
    return judge, tuple(added)


def again(scene: Scene, version: Version) -> list[Version]:
    """The same link with yet a mode less of the same kind."""
    return [other for other in list_mode_versions(scene) if other.on and other.subject == version.subject]


@checked
def audit(
    scene: Scene,
    tolerance: float = 0.01,
    progress: Progress | None = None,
    tol: float = 1e-4,
    together: bool = True,
) -> Audit:
    """Switch each effect on or off, alone and in pairs, change each link's modes by one, and find the smallest scene.

        significance = max(|change of margin| / larger margin, relative change of frequencies, of peak and RMS torques,
                           distance of the tip's paths / how far the tip moves)

    It is infinite where the verdict changes, or what exceeds a limit of the drives. An effect that the scene leaves out is tried with
    small stated parameters. Of a registered model the effects and numbers in its own table are taken away in turn.

    Parameters
    ----------
    scene : Scene
        A scene with links or with a registered model.
    tolerance : float
        Relative change that matters.
    progress : callable, optional
        Called with the description of each version before it is measured.
    tol : float
        Wanted error of the exponents, as in `floquet`, and of the tip's motion; the changes are compared beside the errors.

    together : bool
        Whether to try pairs of effects too, and to look for the smallest scene that is enough.

    Returns
    -------
    Audit
        One row for each change, the most significant first; the pairs that act otherwise together; the minimal scene and its error.

    Raises
    ------
    InputError
        When the scene itself cannot be built.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "effects": {"payload": {"mass": 0.5}}})
    >>> found = fl.audit(scene)
    >>> found.needed
    ('payload',)
    """
    tolerance, tol = positive("tolerance", tolerance), positive("tol", tol)
    judge = Judge(scene, tolerance, tol, progress or (lambda _: None))
    judge.report("the scene as it is")
    base, planned, problem = judge.base, list_versions(scene), ""
    tried, pairs, minimal = list[tuple[Version, Row]](), tuple[Row, ...](), None
    try:
        with part(0.0, 1 / 3):
            for done, version in enumerate(planned):
                judge.report(version.change)
                advance(done / len(planned))
                tried.append((version, judge.row(version)))
        if together and np.isfinite(base.margin):
            with part(1 / 3, 2 / 3):
                pairs = find_interplay(judge, tried)
            with part(2 / 3, 1.0):
                minimal = shrink(judge, tried, pairs)
        elif together:
            problem = "the scene itself has no margin to compare with"
    except TimeLimit as error:
        problem = f"pairs of effects and the minimal scene: {error}"
        if left := ", ".join(version.change for version in planned[len(tried) :]):
            problem = f"not tried in the time: {left}, pairs of effects, the minimal scene; {error.todo}"
    rows = sorted(
        (row for _, row in tried), key=lambda row: -np.nan_to_num(row.significance, nan=np.inf, posinf=np.inf)
    )
    effects, modes = (tuple(row for row in rows if row.kind == kind) for kind in ("effect", "modes"))
    return Audit(base, effects, modes, tolerance, pairs, minimal, problem)


def list_versions(scene: Scene) -> list[Version]:
    """All single changes that are tried."""
    if scene.model is not None:
        return list(versions.list_model_versions(scene))
    return [*versions.list_effect_versions(scene), *list_mode_versions(scene)]


def find_reach(scene: Scene) -> float:
    """The length by which tip errors are measured: of the links and of what lies between them, else of the model's arm, else 1."""
    between = sum(float(np.linalg.norm(link.mount.xyz)) for link in scene.links[1:])
    reach = sum(link.length for link in scene.links) + between
    if reach:
        return reach
    length = arm_length(linearize(build_manipulator(scene), scene.motion, scene.control))
    return length if np.isfinite(length) and length > 0 else 1.0


NEED, CANCEL = "noticed only together", "cancel each other"


def find_interplay(judge: Judge, tried: Sequence[tuple[Version, Row]]) -> tuple[Row, ...]:
    """Try the pairs of effects whose members are both noticed or both not, both on or both off; keep those that act otherwise together.

        noticed only together: s_1 <= tolerance, s_2 <= tolerance, s_12 > tolerance
        cancel each other:     s_1 >  tolerance, s_2 >  tolerance, s_12 <= tolerance

    Of two that only one of is noticed, or of one that is on and one that is off, nothing is tried.
    """
    found = []
    known = [(version, row) for version, row in tried if row.judged and row.kind == "effect"]
    noticed = [(version, version.on, row.significance > judge.tolerance) for version, row in known]
    pairs = [(one, two) for one, two in combinations(noticed, 2) if one[1:] == two[1:]]
    for done, ((one, _, alone), (two, _, _)) in enumerate(pairs):
        both = joined(one, two)
        judge.report(f"together: {both.change}")
        advance(done / len(pairs))
        row = judge.row(both, two.make(one.make(judge.scene)))
        together = row.significance > judge.tolerance
        if alone != together and (row.judged or row.significance == np.inf):
            found.append(replace(row, advice=CANCEL if alone else NEED))
    return tuple(sorted(found, key=lambda row: -row.significance))


def joined(one: Version, two: Version) -> Version:
    """Two changes as one."""
    change = f"{one.change} and {two.subject}"
    table = {f"{v.subject}.{key}": value for v in (one, two) for key, value in v.table.items()}
    units = {f"{v.subject}.{key}": value for v in (one, two) for key, value in v.units.items()}
    return Version(one.make, change, "pair", f"{one.subject} and {two.subject}", one.on, table, units)
