"""Whether the linear model can be believed along a scene's motion, and by which figures."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

SMALL = 0.2
"""The share of the arm's length beyond which a deflection is not small, and of the largest deviation by which the linear answer may miss
the nonlinear one."""
REPEATABLE = 1e-5
"""A share of the arm's length of the order in which good arms repeat a motion (some 0.01 mm for 1 m, ISO 9283): nothing is gained
below it."""
COVERED = 0.5
"""A simulation speaks for a steady deviation of which it has reached this share."""

Answer = Literal["valid", "invalid", "unknown"]
What = Literal["bending", "tip", "difference", "stopped"]


@dataclass(frozen=True)
class ModelEvidence:
    """One figure against its bound, in `unit`; `share` is its part of `whole` (the arm's length, or the largest deviation).

    what: the bending or the whole tip error of the steady motion, the difference between the linear and the nonlinear answer, or
    the time at which the nonlinear equations ended.
    """

    what: What
    value: float
    bound: float
    unit: str
    whole: float = float("nan")

    @property
    def against(self) -> bool:
        """Whether it speaks against the linear model."""
        return not self.value <= self.bound

    @property
    def share(self) -> float:
        """The value as a part of the whole."""
        return self.value / self.whole if self.whole > 0 else float("nan")


@dataclass(frozen=True)
class ModelValidity:
    """Whether the linear model holds along the motion: valid, invalid, or unknown where nothing compares it with the nonlinear one."""

    verdict: Answer
    evidence: tuple[ModelEvidence, ...] = ()

    @property
    def reason(self) -> ModelEvidence | None:
        """The figure that speaks against the linear model, of several the one that says most to a reader."""
        against = {found.what: found for found in self.evidence if found.against}
        return next((against[what] for what in ("tip", "bending", "difference", "stopped") if what in against), None)


def judge_model(
    length: float,
    steady: tuple[float, float] | None = None,
    simulated: tuple[float, float, float, str] | None = None,
    stopped: tuple[float, float] | None = None,
    curved: bool = False,
) -> ModelValidity:
    """Judge the linear model by what is known of a loop's motion.

    The steady motion's tip error may not exceed SMALL of the arm, unless a simulation that came as far agrees; nor may its bending,
    where only links that bend as curves (`curved`) make the simulation a judge of it. The linear answer may miss the nonlinear one by
    SMALL of the largest deviation, or by what no arm repeats. A simulation that ended outside the equations' range is against it.

    Parameters: length: of the arm in m, not a number where it has no points; steady: bending and tip error in m of a steady motion that
    the loop keeps; simulated: how far the answers are apart, the largest deviation, the error of the first, the unit; stopped: when
    the simulation left the range of the equations, and when it was to end, in s.
    """
    found: list[ModelEvidence] = []
    if simulated is not None:
        apart, largest, error, unit = simulated
        floor = REPEATABLE * length if unit == "m" and np.isfinite(length) else REPEATABLE
        found.append(ModelEvidence("difference", apart, max(SMALL * largest, error, floor), unit, largest))
    if stopped is not None:
        found.append(ModelEvidence("stopped", stopped[1], stopped[0], "s", stopped[1]))
    if steady is not None and np.all(np.isfinite([*steady, length])):
        bending, tip = steady
        confirmed = simulated is not None and not found[0].against and simulated[1] >= COVERED * tip
        far = confirmed and curved
        found.append(ModelEvidence("bending", bending, np.inf if far else SMALL * length, "m", length))
        found.append(ModelEvidence("tip", tip, np.inf if confirmed else SMALL * length, "m", length))
    if any(figure.against for figure in found):
        return ModelValidity("invalid", tuple(found))
    return ModelValidity("unknown" if simulated is None else "valid", tuple(found))
