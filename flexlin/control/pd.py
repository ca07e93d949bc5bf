"""Proportional-derivative feedback of the joints, as a design beside the others."""

from collections.abc import Sequence

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import real_array
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.system import PeriodicSystem, as_system


@checked
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

    Parameters
    ----------
    system : PeriodicSystem
        The plant, x = [y; y'], with one input a joint.
    joints : sequence of int
        Number j_i of the coordinate that each input moves.
    kp : sequence of float
        Gains on the angles, in N m/rad.
    kd : sequence of float
        Gains on the rates, in N m s/rad.
    problem : LinearQuadratic, optional
        Weights by which the loop's cost is judged, if it is to be compared.
    name : str
        Name of the design in reports.

    Returns
    -------
    Design
        A constant gain, which is exact: error 0.

    Raises
    ------
    ArgumentError
        When the numbers of joints, inputs and gains differ.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.control.pd_feedback(system, [0], [2.0], [3.0])
    >>> fl.floquet(made.closed_loop).exponents.real.round(6).tolist()
    [-1.0, -2.0]
    """
    system = as_system(system)
    n = system.n // 2
    wanted = f"{system.m}: one for each input"
    places = real_array("joints", joints, (None,))
    if not all(place == int(place) and 0 <= place < n for place in places):
        raise ArgumentError(
            "joints are no coordinates", got=places.tolist(), expected=f"whole numbers from 0 to {n - 1}"
        )
    stiffness, damping = real_array("kp", kp, (None,)), real_array("kd", kd, (None,))
    for what, values in (("joints", places), ("kp", stiffness), ("kd", damping)):
        if len(values) != system.m:
            raise ArgumentError(f"{what} has the wrong length", got=len(values), expected=wanted)
    K = np.zeros((system.m, system.n))
    rows, columns = np.arange(system.m), places.astype(int)
    K[rows, columns] = stiffness
    K[rows, n + columns] = damping
    gain = Constant(K)
    return Design(name, "pd", gain, system.feedback(gain), 0.0, "constant gains as given", problem)
