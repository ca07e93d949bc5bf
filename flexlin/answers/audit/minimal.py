"""The scene with just the effects and modes that it needs at a tolerance, and the error that it makes."""

from collections.abc import Callable, Sequence

from flexlin.answers.audit.judging import Judge
from flexlin.answers.audit.models import list_model_versions
from flexlin.answers.audit.result import Minimal, Row
from flexlin.answers.audit.versions import Version, list_mode_versions
from flexlin.progress import advance
from flexlin.scene.scene import Scene

MOST_GROWTH = 2
"""Rounds in which links are given a mode more."""


def shrink(
    judge: Judge, tried: Sequence[tuple[Version, Row]], pairs: Sequence[Row], report: Callable[[str], None]
) -> Minimal:
    """Give links the modes that they lack, then drop effects and modes one after the other, as long as all of it stays unnoticed.

    Changes that are not noticed alone are tried, the least significant first, and pairs that cancel. Every step is compared with
    the scene that has modes enough, so errors add up under the same tolerance. Greedy: what is left is
    needed, but another order may leave less.
    """
    judge, added = grow(judge, report)
    row, dropped, scene = judge.row(nothing()), list[str](), judge.scene
    cancelling = {row.subject for row in pairs if row.on and row.significance <= judge.tolerance}
    paired = {name for subject in cancelling for name in subject.split(" and ")}
    candidates = sorted(
        (
            (version, row)
            for version, row in tried
            if version.on and row.judged and (row.significance <= judge.tolerance or version.subject in paired)
        ),
        key=lambda item: item[1].significance,
    )
    done = 0
    while candidates:
        version, _ = candidates.pop(0)
        done += 1
        partners = [item for item in candidates if f"{version.subject} and {item[0].subject}" in cancelling]
        partners += [item for item in candidates if f"{item[0].subject} and {version.subject}" in cancelling]
        for partner in (None, *partners):
            trial = version.make(scene) if partner is None else partner[0].make(version.make(scene))
            report(f"minimal scene: {version.change}")
            advance(done / (done + len(candidates) + 1))
            found = judge.row(nothing(), trial)
            if found.judged and found.significance <= judge.tolerance:
                row, scene = found, trial
                dropped.append(version.change)
                if partner is not None:
                    candidates.remove(partner)
                    dropped.append(partner[0].change)
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


def again(scene: Scene, version: Version) -> list[tuple[Version, Row]]:
    """The same link with yet a mode less of the same kind."""
    return [(v, UNKNOWN) for v in mode_versions(scene) if v.on and v.subject == version.subject]


def nothing() -> Version:
    """The change that is none."""
    return Version(lambda scene: scene, "the minimal scene", "minimal", "scene", True, {})


UNKNOWN = Row("", "modes", "", True, {}, 0.0, 0.0, 0.0, 0, 0.0, 0, "unknown", 0.0, "")
