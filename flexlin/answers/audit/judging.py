"""How far one version of a scene is from another, and what that means."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from flexlin.answers.audit.figures import Measure, Part, join_parts, measure
from flexlin.answers.audit.result import Minimal, Row
from flexlin.answers.audit.versions import Version, list_mode_versions, list_model_versions
from flexlin.answers.validity import SMALL
from flexlin.checks import try_to
from flexlin.control.drives import Demand
from flexlin.progress import advance
from flexlin.scene.scene import Scene

TINY = 1e-6
"""A torque, or a motion of the tip, that is nothing beside the largest of all joints, or beside the arm."""


@dataclass(frozen=True)
class Judge:
    """Compares versions with a scene whose figures are `base`; reach: the arm's length in m; tolerance: the relative change that matters.

    tol: wanted error of the exponents.
    """

    scene: Scene
    base: Measure
    reach: float
    tolerance: float
    tol: float

    @classmethod
    def of(cls, scene: Scene, reach: float, tolerance: float, tol: float) -> "Judge":
        """Measure the scene first."""
        return cls(scene, measure(scene, tol), reach, tolerance, tol)

    def row(self, version: Version, scene: Scene | None = None) -> Row:
        """What a version changes; or what another scene does that was made of several."""
        head, nan = (version.change, version.kind, version.subject, version.on, version.table), float("nan")
        other = try_to(lambda: measure(version.make(self.scene) if scene is None else scene, self.tol))
        if isinstance(other, Exception):
            return Row(*head, nan, nan, nan, 0, nan, 0, "unknown", nan, "see the problem", str(other), version.units)
        base = self.base
        own, theirs, unfelt = share_parts(base, other)
        path, torque, marks = self.compare_paths(other), compare_torques(base, other), changed_marks(base, other)
        margin, frequency = theirs.margin - own.margin, compare_frequencies(own, theirs)
        size = float(np.nanmax([compare_margins(own, theirs), frequency, path, torque]))
        if marks or ("unknown" not in (own.verdict, theirs.verdict) and own.verdict != theirs.verdict):
            size = float("inf")
        judged = bool(np.isfinite([margin, path, torque]).all())
        broken = max(other.tip_error, base.tip_error) > SMALL * self.reach
        advice = advise(version, size > self.tolerance, judged, broken, unfelt)
        grown = (getattr(other, what) - getattr(base, what) for what in ("instructions", "microseconds", "coordinates"))
        instructions, microseconds, coordinates = grown
        moved = (*head, margin, frequency, other.tip_error - base.tip_error, instructions, microseconds, coordinates)
        said = (*moved, theirs.verdict, size, advice, "; ".join(other.problems), version.units)
        return Row(*said, path=path, torque=torque, marks=marks, unfelt=unfelt)

    def compare_paths(self, other: Measure) -> float:
        """The largest distance of the two tip paths, relative to how far the tip moves, or to the arm where it rests; 0 without points."""
        first, second = self.base.path, other.path
        if first is None or second is None:
            return float("nan")
        moves = float(np.linalg.norm(first - first.mean(axis=0), axis=1).max())
        size = moves if moves > TINY * self.reach else self.reach
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
    known = [(a.value, b.value) for a, b in pairs if max(a.value, b.value) > TINY * largest[a.unit]]
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


def advise(version: Version, matters: bool, judged: bool, broken: bool, unfelt: tuple[str, ...]) -> str:
    """What to do; `broken`: the tip is so far off in one of the two that the linear model holds for it no longer."""
    if not (matters or judged):
        return "undecided: not all of it could be judged"
    note = f"; neither motors nor motion reach {', '.join(unfelt)}" if unfelt else ""
    if version.kind == "modes":
        if version.on:
            return "its last mode is needed" if matters else f"a mode less is enough{note}"
        return "another mode would be noticed" if matters else f"its modes are enough{note}"
    if version.on:
        return "keep" if matters else f"may be dropped{note}"
    if matters and broken:
        return "with these figures the deflections are not small: it would be noticed, but this is no prediction of how much"
    return "consider it: with these figures it would be noticed" if matters else f"not needed with these figures{note}"


MOST_GROWTH = 2
"""Rounds in which links are given a mode more."""
NOTHING = Version(lambda scene: scene, "the minimal scene", "minimal", "scene", True, {})
"""The change that is none."""


def shrink(
    judge: Judge, tried: Sequence[tuple[Version, Row]], pairs: Sequence[Row], report: Callable[[str], None]
) -> Minimal:
    """Give links the modes that they lack, then drop effects and modes one after the other, as long as all of it stays unnoticed.

    Changes that are not noticed alone are tried, the least significant first, and pairs that cancel. Every step is compared with
    the scene that has modes enough, so errors add up under the same tolerance. Greedy: what is left is
    needed, but another order may leave less.
    """
    judge, added = grow(judge, report)
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
            report(f"minimal scene: {version.change}")
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


def grow(judge: Judge, report: Callable[[str], None]) -> tuple[Judge, tuple[str, ...]]:
    """Compare from here on with a scene whose links have modes enough: one more in each would not be noticed."""
    added = []
    for _ in range(MOST_GROWTH):
        before = judge
        for version in mode_versions(judge.scene):
            if version.on:
                continue
            report(f"minimal scene: {version.change}")
            row = before.row(version)
            if row.significance > judge.tolerance and row.judged:
                judge = Judge.of(version.make(judge.scene), judge.reach, judge.tolerance, judge.tol)
                added.append(version.change)
        if judge is before:
            break
    return judge, tuple(added)


def mode_versions(scene: Scene) -> list[Version]:
    """A mode less and more in each link."""
    versions = list_mode_versions(scene) if scene.model is None else list_model_versions(scene)
    return [version for version in versions if version.kind == "modes"]


def again(scene: Scene, version: Version) -> list[Version]:
    """The same link with yet a mode less of the same kind."""
    return [other for other in mode_versions(scene) if other.on and other.subject == version.subject]
