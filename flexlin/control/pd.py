"""PD feedback, and the feedback that a scene describes, as gains of the linear system."""

from collections.abc import Sequence

import numpy as np

from flexlin.about.linearization import Linearization
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


@checked
def scene_feedback(closed: Linearization, name: str = "the scene's own") -> Design:
    """Return the feedback of a scene's own loop, PD or PID with filters, as a design.

        u = -K [y; y'; z],   z' = rates [y; y'; z]

    Assumes continuous time: sampling, saturation and limited rates of `[control]` are left to whoever calls the gain.

    Parameters
    ----------
    closed : Linearization
        The arm with its loop: fl.linearize(arm, scene.motion, scene.control).
    name : str
        Name of the design.

    Returns
    -------
    Design
        Constant gains, which are exact: error 0; its `controller` holds integrals and filters.

    Raises
    ------
    ArgumentError
        For an arm that was linearized without its loop.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> pid = {"kind": "pid", "kp": [3.0], "kd": [0.5], "ki": [2.0]}
    >>> scene = fl.load_scene("single-link", {"control.feedback": pid, "designs": []})
    >>> made = fl.control.scene_feedback(fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control))
    >>> made.K(np.zeros(1))[0].tolist(), made.controller.names
    ([[3.0, 0.0, 0.0, 0.5, 0.0, 0.0, 2.0]], ('q1_integral',))
    """
    if closed.control is None:
        todo = "linearize the arm with it: fl.linearize(arm, scene.motion, scene.control)"
        raise ArgumentError("these equations hold no feedback", got="control = None", todo=todo)
    law = closed.law
    loop = PeriodicSystem(closed.A, closed.period, closed.input_matrix, closed.breaks)
    return Design(
        name, "scene", law.gain, loop, 0.0, "constant gains as the scene gives them", controller=law.controller
    )
