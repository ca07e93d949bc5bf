"""Errors of what the user gave: exit code 2 on the command line."""

from collections.abc import Sequence
from dataclasses import dataclass

from flexlin.errors.root import FlexlinError

SHOWN = 40
"""Problems of one scene that are listed."""


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
        lines = [f"{source}: {len(self.problems)} problem{'s' if len(self.problems) != 1 else ''}"]
        lines += [str(problem) for problem in self.problems[:SHOWN]]
        lines += [f"... and {len(self.problems) - SHOWN} more"] if len(self.problems) > SHOWN else []
        super().__init__("\n  ".join(lines))
