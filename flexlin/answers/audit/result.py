"""What an audit finds: a row for each change of the scene, and which effects the scene needs."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexlin.answers.audit.figures import Measure
from flexlin.scene.scene import Scene
from flexlin.summary import represent


@dataclass(frozen=True)
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
    >>> from flexlin.answers.audit import Row
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

    __repr__ = represent

    @property
    def judged(self) -> bool:
        """Whether all figures are known: without them nothing can be called needless."""
        return bool(np.isfinite([self.margin, self.path, self.torque]).all())


@dataclass(frozen=True)
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

    __repr__ = represent


@dataclass(frozen=True)
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
    >>> from flexlin.answers.audit import Audit, Measure, Row
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
