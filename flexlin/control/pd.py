"""Proportional-derivative feedback of the joints, as a design beside the others."""

from collections.abc import Sequence

import numpy as np

from flexlin.checks import real_array
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.system import PeriodicSystem


def pd_feedback(
    system: PeriodicSystem,
    joints: Sequence[int],
    kp: Sequence[float],
    kd: Sequence[float],
    problem: LinearQuadratic | None = None,
    name: str = "PD",
) -> Design:
    """Close independent PD loops about the joints of a second-order system.

        u_i = -kp_i y_(j_i) - kd_i y'_(j_i)

    Parameters: system with x = [y; y'] and one input a joint; joints: the coordinate y that each input moves; kp in N m/rad, kd in
    N m s/rad; problem: weights by which the loop's cost is judged, if it is to be compared.
    Returns: a design with a constant gain, which is exact: error 0.
    Raises: ArgumentError when the numbers of joints, inputs and gains differ.
    """
    n = system.n // 2
    wanted = f"{system.m}: one for each input"
    for what, values in (("joints", joints), ("kp", kp), ("kd", kd)):
        if len(values) != system.m:
            raise ArgumentError(f"{what} has the wrong length", got=len(values), expected=wanted)
    K = np.zeros((system.m, system.n))
    rows = np.arange(system.m)
    K[rows, list(joints)] = real_array("kp", kp)
    K[rows, [n + j for j in joints]] = real_array("kd", kd)
    gain = Constant(K)
    return Design(name, "pd", gain, system.feedback(gain), 0.0, "constant gains as given", problem)
