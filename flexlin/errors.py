"""Named errors: each says what was got, what was expected and what to do.

`InputError` and its children are the user's to mend (exit code 2 on the command line);
`NumericalError` and its children say that a sound question has no trustworthy answer (exit code 1).
"""

from collections.abc import Sequence
from dataclasses import dataclass


class FlexlinError(Exception):
    """The root of all errors that flexlin raises on purpose.

    The message reads: what happened; got ..., expected ...; what to do.
    """

    def __init__(self, what: str, *, got: object = None, expected: str | None = None, todo: str | None = None):
        self.what, self.got, self.expected, self.todo = what, got, expected, todo
        parts = [what]
        if got is not None or expected is not None:
            facts = [f"got {got}"] if got is not None else []
            facts += [f"expected {expected}"] if expected is not None else []
            parts.append(", ".join(facts))
        if todo is not None:
            parts.append(todo)
        super().__init__("; ".join(parts))


class InputError(FlexlinError, ValueError):
    """Something that the user gave cannot be used."""


class ArgumentError(InputError):
    """An argument of a public function has the wrong shape, type or range, or is not finite."""


class DesignError(ArgumentError):
    """A controller design is asked for what it cannot say, such as its cost when it has no weights."""


class OutputError(InputError):
    """Results cannot be written where the user asked for them."""


class ModelError(InputError):
    """A manipulator's equations contradict mechanics (M not symmetric, not positive definite, not finite ...)."""


class MotionError(InputError):
    """A basic motion cannot be used (not periodic, wrong number of joints, samples not increasing ...)."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a scene: where, what was got, what was expected."""

    key: str
    got: str
    expected: str

    def __str__(self) -> str:
        return f"{self.key}: got {self.got}, expected {self.expected}"


SHOWN = 40
"""Problems that one message lists."""


class SceneError(InputError):
    """A scene file is missing, broken or contradicts itself; `problems` holds all of them at once."""

    def __init__(self, source: str, problems: Sequence[Problem]):
        self.source, self.problems = source, tuple(problems)
        lines = [f"{source}: {len(self.problems)} problem{'s' if len(self.problems) != 1 else ''}"]
        lines += [str(problem) for problem in self.problems[:SHOWN]]
        lines += [f"... and {len(self.problems) - SHOWN} more"] if len(self.problems) > SHOWN else []
        super().__init__("\n  ".join(lines))


class NumericalError(FlexlinError, ArithmeticError):
    """A sound question that has no trustworthy numerical answer as it was asked."""


class SingularMassMatrix(NumericalError):
    """The mass matrix cannot be inverted to working precision."""


class TooManySegments(NumericalError):
    """The asked accuracy would need more segments of the period than the engine allows."""


class ToleranceNotReached(NumericalError):
    """An iteration or refinement stopped before the asked accuracy."""


class TimeLimit(NumericalError):
    """A stage of the work needs more time than it was given."""


class ResonantForcing(NumericalError):
    """1 is (nearly) a multiplier: no bounded periodic response exists."""


class IllPosedSegment(NumericalError):
    """A segment of a linear-quadratic problem has no solution (I + G H singular)."""


class NotStabilizable(NumericalError):
    """An unstable Floquet mode cannot be reached by the input."""


class NotDetectable(NumericalError):
    """An unstable Floquet mode is not seen by the weight or the measurement."""


class SingularClosure(NumericalError):
    """The closure's Jacobian V is singular at the evaluation point."""


class TooLarge(FlexlinError, MemoryError):
    """A request whose size in bytes would be unreasonable; nothing was allocated."""
