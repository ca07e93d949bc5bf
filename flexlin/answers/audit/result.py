"""What an audit finds: a row for each change of the scene, and which effects the scene needs."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexlin.answers.audit.figures import Measure
from flexlin.summary import represent


@dataclass(frozen=True)
class Row:
    """One change of the scene and what came of it.

    change: what was done; kind: "effect" or "modes"; subject: the effect's name or the link's key; on: whether the scene has it;
    table, units: the effect's figures in the version that has it. Differences are version minus scene: margin in 1/s, tip_error in m,
    frequency: largest relative change of the slower half of the frequencies; instructions; microseconds a point; coordinates.
    significance: largest of the relative changes (of margin, frequencies, and tip error against the arm's reach);
    advice: what to do at the audit's tolerance; problem: why the version could not be judged.
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

    __repr__ = represent

    @property
    def judged(self) -> bool:
        """Whether all figures could be had: without them nothing can be called needless."""
        return bool(np.isfinite(self.margin) and np.isfinite(self.tip_error))


@dataclass(frozen=True)
class Audit:
    """What a scene needs: the scene's own figures, and one row for each change, the most significant first."""

    base: Measure
    effects: tuple[Row, ...]
    modes: tuple[Row, ...]
    tolerance: float

    __repr__ = represent

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
