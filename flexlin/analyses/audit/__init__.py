"""Which effects and how many modes a scene needs: each switched in turn and in pairs, what changes, and what it costs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from flexlin.analyses.audit.figures import Measure, measure
from flexlin.analyses.audit.judging import Audit, Judge, Minimal, Progress, Row, shrink
from flexlin.analyses.audit.versions import (
    Version,
    list_effect_versions,
    list_mode_versions,
    list_model_versions,
    read_scale,
)
from flexlin.analyses.judging import arm_length
from flexlin.arguments import checked
from flexlin.checks import positive
from flexlin.errors import TimeLimit
from flexlin.linearization.linear import linearize
from flexlin.mechanics import build_manipulator
from flexlin.resources import advance, part
from flexlin.scene.scene import Scene

__all__ = ["Audit", "Measure", "Minimal", "Row", "audit", "measure"]


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
    report = progress or (lambda text: None)
    report("the scene as it is")
    judge = Judge.of(scene, find_reach(scene), tolerance, tol, report)
    with part(0.0, 1 / 3):
        tried, problem = try_versions(judge)
    pairs: tuple[Row, ...] = ()
    minimal: Minimal | None = None
    if together and not problem:
        pairs, minimal, problem = look_further(judge, tried)
    rows = sorted(
        (row for _, row in tried), key=lambda row: -row.significance if np.isfinite(row.significance) else -np.inf
    )
    effects, modes = (tuple(row for row in rows if row.kind == kind) for kind in ("effect", "modes"))
    return Audit(judge.base, effects, modes, tolerance, pairs, minimal, problem)


def try_versions(judge: Judge) -> tuple[list[tuple[Version, Row]], str]:
    """All single changes, as far as time allows, and what was left out."""
    tried: list[tuple[Version, Row]] = []
    versions = list_versions(judge.scene)
    try:
        for done, version in enumerate(versions):
            judge.report(version.change)
            advance(done / len(versions))
            tried.append((version, judge.row(version)))
    except TimeLimit as error:
        left = ", ".join(version.change for version in versions[len(tried) :])
        return tried, f"not tried in the time: {left}, pairs of effects, the minimal scene; {error.todo}"
    return tried, ""


def look_further(judge: Judge, tried: list[tuple[Version, Row]]) -> tuple[tuple[Row, ...], Minimal | None, str]:
    """Pairs and the minimal scene, as far as time allows: what single changes do is known then already."""
    pairs: tuple[Row, ...] = ()
    if not np.isfinite(judge.base.margin):
        return pairs, None, "the scene itself has no margin to compare with"
    try:
        with part(1 / 3, 2 / 3):
            pairs = find_interplay(judge, tried)
        with part(2 / 3, 1.0):
            return pairs, shrink(judge, tried, pairs), ""
    except TimeLimit as error:
        return pairs, None, f"pairs of effects and the minimal scene: {error}"


def list_versions(scene: Scene) -> list[Version]:
    """All single changes that are tried."""
    if scene.model is not None:
        return list(list_model_versions(scene))
    return [*list_effect_versions(scene, read_scale(scene)), *list_mode_versions(scene)]


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
    pairs = list(list_pairs(tried, judge.tolerance))
    for done, ((one, first), (two, _)) in enumerate(pairs):
        both = joined(one, two)
        judge.report(f"together: {both.change}")
        advance(done / len(pairs))
        row = judge.row(both, two.make(one.make(judge.scene)))
        alone, together = first.significance > judge.tolerance, row.significance > judge.tolerance
        if np.isfinite(row.significance) and row.judged and alone != together:
            found.append(replace(row, advice=CANCEL if alone else NEED))
        elif not alone and row.significance == np.inf:
            found.append(replace(row, advice=NEED))
    return tuple(sorted(found, key=lambda row: -row.significance))


def list_pairs(tried: Sequence[tuple[Version, Row]], tolerance: float) -> Iterator[tuple[tuple[Version, Row], ...]]:
    """Pairs of effects that were judged."""
    known = [item for item in tried if item[1].judged and item[1].kind == "effect"]
    for first, second in combinations(known, 2):
        same = (first[1].significance > tolerance) == (second[1].significance > tolerance)
        if same and first[0].on == second[0].on:
            yield first, second


def joined(one: Version, two: Version) -> Version:
    """Two changes as one."""
    change = f"{one.change} and {two.subject}"
    table = {f"{v.subject}.{key}": value for v in (one, two) for key, value in v.table.items()}
    units = {f"{v.subject}.{key}": value for v in (one, two) for key, value in v.units.items()}
    return Version(one.make, change, "pair", f"{one.subject} and {two.subject}", one.on, table, units)
