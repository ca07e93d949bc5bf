"""Named errors: each says what was got, what was expected and what to do.

`InputError` and its children are the user's to correct (exit code 2 on the command line);
`NumericalError` and its children say that a sound question has no trustworthy answer (exit code 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

SHOWN_PROBLEMS = 40
"""Problems of one scene that are listed."""


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

    def __reduce__(self) -> tuple[Any, ...]:
        return restore_error, (type(self), str(self), vars(self))


def restore_error(kind: type[FlexlinError], message: str, facts: dict[str, Any]) -> FlexlinError:
    """An error as it was in another process, whatever its class is made from."""
    base: Any = kind.__base__  # kind's own __new__ may be MemoryError's, which makes no other class
    error: FlexlinError = base.__new__(kind, message)
    vars(error).update(facts)
    return error


def counted(number: int, noun: str) -> str:
    """So many of something, in words: 1 input, 2 inputs, 1 entry, 2 entries."""
    return f"{number} {noun if number == 1 else noun[:-1] + 'ies' if noun.endswith('y') else noun + 's'}"


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


NO_MEMORY = (
    "std::bad_alloc",
    "failed to map segment",
    "Cannot allocate memory",
    "can't start new thread",
    "Unable to allocate",
)
"""How libraries say that there is no memory, in errors of other kinds."""


def lacks_memory(error: BaseException) -> bool:
    """Whether an error is due to memory that gave out, by its kind or by its words; so are those that came of it."""
    known = list[BaseException]()
    while error not in known:
        known.append(error)
        error = error.__cause__ or error.__context__ or error
    return any(isinstance(one, MemoryError) or any(words in str(one) for words in NO_MEMORY) for one in known)


class InputError(FlexlinError, ValueError):
    """Something that the user gave cannot be used."""


class ArgumentError(InputError):
    """An argument of a public function has the wrong shape, type or range, or is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> fl.kronecker.kronecker_power(np.eye(2), 0)
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
        lines = [f"{source}: {counted(len(self.problems), 'problem')}"]
        lines += [str(problem) for problem in self.problems[:SHOWN_PROBLEMS]]
        lines += [f"... and {len(self.problems) - SHOWN_PROBLEMS} more"] if len(self.problems) > SHOWN_PROBLEMS else []
        super().__init__("\n  ".join(lines))


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
    >>> from flexlin.analyses.clock import time_limit
    >>> oscillator = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.1]], 1.0)
    >>> with time_limit("exponents", 0.2):
    ...     while True:
    ...         answer = fl.floquet(oscillator)
    Traceback (most recent call last):
        ...
    flexlin.errors.TimeLimit: exponents: stopped at the time limit...
    """


class SimulationStopped(NumericalError):
    """A nonlinear simulation cannot go on from a state that it has reached.

    Parameters
    ----------
    what : str
        What happened.
    t : float
        The last time that was reached, in s.
    reached : array, shape (2n,), optional
        The deviation [y; y'] from the rigid motion at that time: a state of the arm, never a trial of the integrator.
    left_range : bool
        Whether that state lies where the equations lose their meaning, or far from the rigid motion; else the integrator was given
        up for a reason of its own.
    **facts : dict
        What was got and what to do, as for every `FlexlinError`.

    Examples
    --------
    >>> from flexlin.errors import SimulationStopped
    >>> SimulationStopped("the nonlinear simulation stopped at t = 0.1 s", t=0.1, left_range=True).left_range
    True
    """

    def __init__(self, what: str, *, t: float = nan, reached: Any = None, left_range: bool = False, **facts: Any):
        self.t, self.reached, self.left_range = t, reached, left_range
        super().__init__(what, **facts)


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


class NotStable(NumericalError):
    """A quantity that only a stable system has was asked of one that is unstable or undecided.

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.hinf_norm(fl.PeriodicSystem([[0.1]], 1.0, B=[[1.0]]), [[1.0]])
    Traceback (most recent call last):
        ...
    flexlin.errors.NotStable: the norm is infinite or unknown...
    """


class NotCertified(NotStable):
    """A loop gets no certificate: it is not stable, undecided, or no Lyapunov matrix that was tried proves it.

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.floquet(fl.PeriodicSystem([[0.1]], 1.0)).certificate()
    Traceback (most recent call last):
        ...
    flexlin.errors.NotCertified: the loop is unstable...
    """


KINDS = [name for name, kind in globals().items() if isinstance(kind, type) and issubclass(kind, FlexlinError)]
__all__ = ["Problem", *sorted(KINDS)]
"""Every kind of error is public."""
