"""Named errors: each says what was got, what was expected and what to do.

`InputError` and its children are the user's to correct (exit code 2 on the command line);
`NumericalError` and its children say that a sound question has no trustworthy answer (exit code 1).
"""

from collections.abc import Sequence
from dataclasses import dataclass


class FlexlinError(Exception):
    """The root of all errors that flexlin raises on purpose.

    The message reads: what happened; got ..., expected ...; what to do.

    Parameters
    ----------
    what : str
        What happened.
    got : object, optional
        What was given or found.
    expected : str, optional
        What was expected.
    todo : str, optional
        What to do about it.

    Examples
    --------
    >>> from flexlin.errors import FlexlinError, InputError, NumericalError
    >>> print(FlexlinError("the gain does not fit", got=(1, 2), expected="(1, 4)", todo="give one entry for each state"))
    the gain does not fit; got (1, 2), expected (1, 4); give one entry for each state
    >>> issubclass(InputError, ValueError), issubclass(NumericalError, ArithmeticError)
    (True, True)
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
    """An argument of a public function has the wrong shape, type or range, or is not finite.

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.kronecker.kronecker_power(2.0, 0)
    Traceback (most recent call last):
        ...
    flexlin.errors.ArgumentError: a Kronecker power needs at least one factor; got 0, expected 1, 2, 3 ...
    """


class DesignError(ArgumentError):
    """A controller design is asked for what it cannot say, such as its cost when it has no weights.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> fl.control.pd_feedback(system, [0], [1.0], [1.0]).cost([1.0, 0.0])
    Traceback (most recent call last):
        ...
    flexlin.errors.DesignError: the design 'PD' has no cost...
    """


class OutputError(InputError):
    """Results cannot be written where the user asked for them."""


class ModelError(InputError):
    """A manipulator's equations contradict mechanics (M not symmetric, not positive definite, not finite ...).

    Examples
    --------
    >>> import casadi as ca
    >>> from flexlin import Manipulator
    >>> s, rate = ca.SX.sym("s"), ca.SX.sym("rate")
    >>> Manipulator.from_lagrangian(s, rate, -(rate**2) / 2, s**2)
    Traceback (most recent call last):
        ...
    flexlin.errors.ModelError: M is not positive definite at s = 0: a motion mainly along s1 (M[0, 0] = -1) has no kinetic energy...
    """


class MotionError(InputError):
    """A basic motion cannot be used (not periodic, wrong number of joints, samples not increasing ...).

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.build_motion(fl.load_scene("single-link").motion, joints=2)
    Traceback (most recent call last):
        ...
    flexlin.errors.MotionError: the motion has the wrong number of joints; got 1, expected 2
    """


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a scene.

    Parameters
    ----------
    key : str
        Dotted path of the entry.
    got : str
        What stands there.
    expected : str
        What was expected.

    Examples
    --------
    >>> from flexlin.errors import Problem
    >>> print(Problem("links.0.length", "-1.0", "a number greater than 0"))
    links.0.length: got -1.0, expected a number greater than 0
    """

    key: str
    got: str
    expected: str

    def __str__(self) -> str:
        return f"{self.key}: got {self.got}, expected {self.expected}"


SHOWN = 40  # problems that one message lists


class SceneError(InputError):
    """A scene file is missing, broken or contradicts itself.

    Parameters
    ----------
    source : str
        Name of the scene.
    problems : sequence of Problem
        All problems at once; the message lists the first 40.

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.load_scene("single-link", {"links.0.length": -1.0})
    Traceback (most recent call last):
        ...
    flexlin.errors.SceneError: ...: 1 problem
      links.0.length: got -1.0, expected a number greater than or equal to 0
    """

    def __init__(self, source: str, problems: Sequence[Problem]):
        self.source, self.problems = source, tuple(problems)
        lines = [f"{source}: {len(self.problems)} problem{'s' if len(self.problems) != 1 else ''}"]
        lines += [str(problem) for problem in self.problems[:SHOWN]]
        lines += [f"... and {len(self.problems) - SHOWN} more"] if len(self.problems) > SHOWN else []
        super().__init__("\n  ".join(lines))

    def __reduce__(self) -> tuple[type["SceneError"], tuple[str, tuple[Problem, ...]]]:
        return type(self), (self.source, self.problems)


class NumericalError(FlexlinError, ArithmeticError):
    """A sound question that has no trustworthy numerical answer as it was asked."""


class SingularMassMatrix(NumericalError):
    """The mass matrix cannot be inverted to working precision.

    Examples
    --------
    >>> import flexlin as fl
    >>> zero = [[0.0, 0.0], [0.0, 0.0]]
    >>> fl.PeriodicSystem.from_second_order([[1.0, 1.0], [1.0, 1.0]], zero, zero, 1.0)
    Traceback (most recent call last):
        ...
    flexlin.errors.SingularMassMatrix: the mass matrix is singular at t = 0 s...
    """


class TooManySegments(NumericalError):
    """The asked accuracy would need more segments of the period than the engine allows.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[-1.0]], 1.0)
    >>> try:
    ...     fl.forced_response(system, lambda t: np.cos(600.0 * t)[:, None] ** 9, max_segments=8)
    ... except fl.errors.TooManySegments as error:
    ...     print(error.todo is not None)
    True
    """


class ToleranceNotReached(NumericalError):
    """An iteration or refinement stopped before the asked accuracy.

    Examples
    --------
    >>> import casadi as ca
    >>> from flexlin.series import solve_implicit
    >>> u, v = ca.SX.sym("u"), ca.SX.sym("v")
    >>> solve_implicit(v**2 + u, u, v, [1.0], [0.5])
    Traceback (most recent call last):
        ...
    flexlin.errors.ToleranceNotReached: f(u0, v) = 0 has no solution that Newton's method reaches...
    """


class TimeLimit(NumericalError):
    """A stage of the work needs more time than it was given.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.answers.clock import time_limit
    >>> oscillator = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.1]], 1.0)
    >>> with time_limit("exponents", 0.2):
    ...     while True:
    ...         answer = fl.floquet(oscillator)
    Traceback (most recent call last):
        ...
    flexlin.errors.TimeLimit: exponents: stopped at the time limit...
    """


class ResonantForcing(NumericalError):
    """1 is (nearly) a multiplier: no bounded periodic response exists.

    Examples
    --------
    >>> import flexlin as fl
    >>> oscillator = fl.PeriodicSystem([[0.0, 1.0], [-1.0, 0.0]], 6.283185307179586)
    >>> fl.forced_response(oscillator, [0.0, 1.0])
    Traceback (most recent call last):
        ...
    flexlin.errors.ResonantForcing: 1 is (nearly) a Floquet multiplier, so the periodic response is not bounded or not unique...
    """


class IllPosedSegment(NumericalError):
    """A segment of a linear-quadratic problem has no solution (I + G H singular)."""


class NotStabilizable(NumericalError):
    """An unstable Floquet mode cannot be reached by the input.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[1.0, 0.0], [0.0, -1.0]], 1.0, B=[[0.0], [1.0]])
    >>> fl.periodic_lqr(system, [[1.0, 0.0], [0.0, 1.0]], [[1.0]])
    Traceback (most recent call last):
        ...
    flexlin.errors.NotStabilizable: a mode that does not decay cannot be reached by the input...
    """


class NotDetectable(NumericalError):
    """An unstable Floquet mode is not seen by the weight or the measurement.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[1.0, 0.0], [0.0, -1.0]], 1.0, B=[[1.0], [1.0]])
    >>> fl.periodic_lqr(system, [[0.0, 0.0], [0.0, 1.0]], [[1.0]])
    Traceback (most recent call last):
        ...
    flexlin.errors.NotDetectable: a mode that does not decay is not seen by the weight Q...
    """


class SingularClosure(NumericalError):
    """The closure's Jacobian V is singular at the evaluation point.

    Examples
    --------
    >>> import casadi as ca
    >>> import flexlin as fl
    >>> u, v = ca.SX.sym("u"), ca.SX.sym("v")
    >>> fl.implicit_taylor(v**2 - u, u, v, [0.0], [0.0], 3)
    Traceback (most recent call last):
        ...
    flexlin.errors.SingularClosure: V = D_v f is singular at the point of evaluation...
    """


class TooLarge(FlexlinError, MemoryError):
    """A request whose size in bytes would be unreasonable; nothing was allocated.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> fl.simulate(lin, periods=1e9)
    Traceback (most recent call last):
        ...
    flexlin.errors.TooLarge: a simulation of 1e+09 periods is too large...
    """


class NotPeriodic(InputError):
    """A coefficient does not repeat with the period that was given.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem(lambda t: np.cos(2 * t)[:, None, None], period=2.0)
    >>> fl.floquet(system)
    Traceback (most recent call last):
        ...
    flexlin.errors.NotPeriodic: A(t) does not repeat with the period T = 2 s...
    """


class UnresolvedCoefficient(NumericalError):
    """A coefficient varies faster somewhere than any representation within the limits can follow.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem(lambda t: np.sin(2e6 * np.pi * t)[:, None, None], period=1.0)
    >>> fl.floquet(system)
    Traceback (most recent call last):
        ...
    flexlin.errors.UnresolvedCoefficient: A(t) cannot be resolved near...
    """


__all__ = sorted(
    name for name, kind in list(globals().items()) if isinstance(kind, type) and kind.__module__ == __name__
)
