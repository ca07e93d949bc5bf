"""How far one version of a scene is from another, and what that means."""

from dataclasses import dataclass

import numpy as np

from flexlin.answers.audit.figures import Measure, measure
from flexlin.answers.audit.result import Row
from flexlin.answers.audit.versions import Version
from flexlin.answers.validity import SMALL
from flexlin.errors import FlexlinError
from flexlin.scene.scene import Scene


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
        head = (version.change, version.kind, version.subject, version.on, version.table)
        try:
            other = measure(version.make(self.scene) if scene is None else scene, self.tol)
        except FlexlinError as error:
            nan = float("nan")
            return Row(*head, nan, nan, nan, 0, nan, 0, "unknown", nan, "see the problem", str(error), version.units)
        size, base = self.significance(other), self.base
        margin, tip = other.margin - base.margin, other.tip_error - base.tip_error
        if np.isnan(tip) and not (base.problems or other.problems):
            tip = 0.0  # a model without points has no tip
        judged = bool(np.isfinite(margin) and np.isfinite(tip))
        broken = max(other.tip_error, base.tip_error) > SMALL * self.reach
        return Row(
            *head,
            margin,
            compare_frequencies(base, other),
            tip,
            other.instructions - base.instructions,
            other.microseconds - base.microseconds,
            other.coordinates - base.coordinates,
            other.verdict,
            size,
            advise(version, size > self.tolerance, judged, broken),
            "; ".join(other.problems),
            version.units,
        )

    def significance(self, other: Measure) -> float:
        """The largest of the relative changes, infinite where the verdict is another one."""
        base, tip = self.base, abs(other.tip_error - self.base.tip_error)
        if "unknown" not in (base.verdict, other.verdict) and base.verdict != other.verdict:
            return float("inf")
        by_tip = tip / self.reach if np.isfinite(tip) else 0.0
        return max(compare_margins(base, other), compare_frequencies(base, other), by_tip)


def compare_frequencies(base: Measure, other: Measure) -> float:
    """The largest relative change of the slower half of the frequencies that both have: the last modes of a basis are never accurate."""
    count = (min(len(base.frequencies), len(other.frequencies)) + 1) // 2
    first, second = base.frequencies[:count], other.frequencies[:count]
    scale = np.maximum(np.maximum(first, second), 1e-9)
    return float(np.max(np.abs(first - second) / scale, initial=0.0))


def compare_margins(base: Measure, other: Measure) -> float:
    """The change of the margin against the larger of the two; 0 within their errors or where one is unknown."""
    change = abs(other.margin - base.margin)
    if not change > base.margin_error + other.margin_error:
        return 0.0
    return change / max(abs(base.margin), abs(other.margin))


def advise(version: Version, matters: bool, judged: bool, broken: bool) -> str:
    """What to do; `broken`: the tip is so far off in one of the two that the linear model holds for it no longer."""
    if not (matters or judged):
        return "undecided: not all of it could be judged"
    if version.kind == "modes":
        if version.on:
            return "its last mode is needed" if matters else "a mode less is enough"
        return "another mode would be noticed" if matters else "its modes are enough"
    if version.on:
        return "keep" if matters else "may be dropped"
    if matters and broken:
        return "with these figures the deflections are not small: it would be noticed, but this is no prediction of how much"
    return "consider it: with these figures it would be noticed" if matters else "not needed with these figures"
