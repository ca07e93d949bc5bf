"""Each effect switched on or off in turn, each link given a mode more or less: what changes, and what it costs."""

from collections.abc import Callable

import numpy as np

from flexlin.answers.audit.figures import Measure, measure
from flexlin.answers.audit.result import Audit, Row
from flexlin.answers.audit.scale import read_scale
from flexlin.answers.audit.versions import Version, list_effect_versions, list_mode_versions
from flexlin.checks import positive
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.scene.scene import Scene

Progress = Callable[[str], None]


def audit(scene: Scene, tolerance: float = 0.01, progress: Progress | None = None, tol: float = 1e-4) -> Audit:
    """Switch each effect on or off in turn, change each link's modes by one, and compare.

        significance = max(|change of margin| / larger margin, relative change of frequencies, |change of tip error| / reach)

    An effect that the scene leaves out is tried with small stated parameters; infinite significance means another verdict.
    Assumes that effects may be judged one at a time: two that are each small may matter together.

    Parameters
    ----------
    scene : Scene
        A scene with links.
    tolerance : float
        Relative change that matters.
    progress : callable, optional
        Called with the description of each version before it is measured.
    tol : float
        Wanted error of the exponents, as in `floquet`, and of the tip's motion; the changes are compared beside the errors.

    Returns
    -------
    Audit
        One row for each change, the most significant first.

    Raises
    ------
    ArgumentError
        For a scene with a registered model.
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
    if scene.model is not None:
        raise ArgumentError(
            "a registered model has no effects to switch", got=scene.model, expected="a scene with links"
        )
    report = progress or (lambda text: None)
    report("the scene as it is")
    base, scale, reach = measure(scene, tol), read_scale(scene), sum(link.length for link in scene.links) or 1.0
    rows = []
    for version in (*list_effect_versions(scene, scale), *list_mode_versions(scene)):
        report(version.change)
        rows.append(_compare(version, base, reach, tolerance, tol))
    rows.sort(key=lambda row: -row.significance if np.isfinite(row.significance) else -np.inf)
    effects, modes = (tuple(row for row in rows if row.kind == kind) for kind in ("effect", "modes"))
    return Audit(base, effects, modes, tolerance)


def _compare(version: Version, base: Measure, reach: float, tolerance: float, tol: float) -> Row:
    head = (version.change, version.kind, version.subject, version.on, version.table)
    try:
        other = measure(version.scene, tol)
    except FlexlinError as error:
        nan = float("nan")
        return Row(*head, nan, nan, nan, 0, nan, 0, "unknown", nan, "see the problem", str(error), version.units)
    margin, frequency, tip_error = (
        other.margin - base.margin,
        _compare_frequencies(base, other),
        other.tip_error - base.tip_error,
    )
    significance = max(
        _compare_margins(base, other), frequency, abs(tip_error) / reach if np.isfinite(tip_error) else 0.0
    )
    if "unknown" not in (base.verdict, other.verdict) and base.verdict != other.verdict:
        significance = float("inf")
    return Row(
        *head,
        margin,
        frequency,
        tip_error,
        other.instructions - base.instructions,
        other.microseconds - base.microseconds,
        other.coordinates - base.coordinates,
        other.verdict,
        significance,
        _advise(version, significance > tolerance, bool(np.isfinite(margin) and np.isfinite(tip_error))),
        "; ".join(other.problems),
        version.units,
    )


def _compare_frequencies(base: Measure, other: Measure) -> float:
    """The largest relative change of the slower half of the frequencies that both have: the last modes of a basis are never accurate."""
    count = (min(len(base.frequencies), len(other.frequencies)) + 1) // 2
    first, second = base.frequencies[:count], other.frequencies[:count]
    scale = np.maximum(np.maximum(first, second), 1e-9)
    return float(np.max(np.abs(first - second) / scale, initial=0.0))


def _compare_margins(base: Measure, other: Measure) -> float:
    """The change of the margin against the larger of the two; 0 within their errors or where one is unknown."""
    change = abs(other.margin - base.margin)
    if not change > base.margin_error + other.margin_error:
        return 0.0
    return change / max(abs(base.margin), abs(other.margin))


def _advise(version: Version, matters: bool, judged: bool) -> str:
    if not (matters or judged):
        return "undecided: not all of it could be judged"
    if version.kind == "modes":
        if version.on:
            return "its last mode is needed" if matters else "a mode less is enough"
        return "another mode would be noticed" if matters else "its modes are enough"
    if version.on:
        return "keep" if matters else "may be dropped"
    return "consider it: with these figures it would be noticed" if matters else "not needed with these figures"
