"""The scene's own feedback as a design, so that exports write it as they write designed gains."""

from flexlin.about.linearization import Linearization
from flexlin.arguments import checked
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError
from flexlin.periodic.system import PeriodicSystem


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
    loop = PeriodicSystem(closed.state_matrix, closed.period, closed.input_matrix, closed.breaks)
    return Design(
        name, "scene", law.gain, loop, 0.0, "constant gains as the scene gives them", controller=law.controller
    )
