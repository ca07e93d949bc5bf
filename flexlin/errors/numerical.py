"""Errors of sound questions that have no trustworthy answer: exit code 4 on the command line."""

from typing import Any

from flexlin.errors.root import FlexlinError


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
    >>> from flexlin.answers.limits import time_limit
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
    what, got, todo : str
        As for every `FlexlinError`.
    t : float
        The last time that was reached, in s.
    reached : array, shape (2n,), optional
        The deviation [y; y'] from the rigid motion at that time: a state of the arm, never a trial of the integrator.
    left_range : bool
        Whether that state lies where the equations lose their meaning, or far from the rigid motion; else the integrator was given
        up for a reason of its own.

    Examples
    --------
    >>> from flexlin.errors import SimulationStopped
    >>> SimulationStopped("the nonlinear simulation stopped at t = 0.1 s", t=0.1, left_range=True).left_range
    True
    """

    def __init__(
        self,
        what: str,
        *,
        got: object = None,
        todo: str | None = None,
        t: float = float("nan"),
        reached: Any = None,
        left_range: bool = False,
    ):
        self.t, self.reached, self.left_range = t, reached, left_range
        super().__init__(what, got=got, todo=todo)


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


class NotCertified(NumericalError):
    """A loop gets no certificate: it is not stable, undecided, or no Lyapunov matrix that was tried proves it.

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.floquet(fl.PeriodicSystem([[0.1]], 1.0)).certificate()
    Traceback (most recent call last):
        ...
    flexlin.errors.NotCertified: the loop is unstable...
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
