"""Integral action: a system extended by the integrals of what must not keep an error."""

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.related import extend_system
from flexlin.periodic.system import PeriodicSystem, as_system


@checked
def with_integral_action(system: PeriodicSystem, measured: ArrayLike) -> PeriodicSystem:
    """Extend a system by the integrals of measured errors, so that any design on it acts on them too.

        [x; e]' = [[A, 0], [C, 0]] [x; e] + [B; 0] u

    An LQR for it, u = -K_x x - K_e e, leaves no mean error of C x behind a constant disturbance of the torque.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and an input.
    measured : array_like, shape (p, n)
        C, such as the rows of the joint angles.

    Returns
    -------
    PeriodicSystem
        The system of n + p states.

    Raises
    ------
    ArgumentError
        When C does not fit or the system has no input.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> fl.control.with_integral_action(system, [[1.0, 0.0]]).A([0.0])[0].tolist()
    [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    """
    system = as_system(system)
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
    C = real_array("measured", measured, (None, system.n))
    return extend_system(system, np.hstack([C, np.zeros((len(C), len(C)))]))
