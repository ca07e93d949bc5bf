"""A manipulator as a system of python-control: x = [s; s'], s'' = M^-1 (B u - (C s' + g + d))."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from flexlin.checks import Array, positive
from flexlin.errors import ArgumentError
from flexlin.scene.control import RATE

if TYPE_CHECKING:
    import control


def nonlinear_system(arm: Any, name: str, period: float | None) -> "control.NonlinearIOSystem":
    """A `Manipulator` with inputs named by what they drive, and states that are its outputs; `period`: in s, of a load that is periodic.

    Raises: ArgumentError where such a load has no period.
    """
    import control

    if arm.phase is not None and period is None:
        todo = "give the period of the motion: arm.to_control(period=lin.period)"
        raise ArgumentError("a periodic load needs a period", got="none", expected="a time in s", todo=todo)
    T = 1.0 if period is None else positive("period", period)
    p, n, phase = arm.parameters, arm.n, ca.SX.sym("phase") if arm.phase is None else arm.phase
    left = ca.substitute(arm.residual, arm.s_ddot, ca.DM.zeros(n))
    outputs = [ca.densify(part) for part in (arm.M, left, arm.B)]
    equations = ca.Function("equations", [arm.s, arm.s_dot, phase, p.symbols], outputs)
    known = dict(zip(p.paths, p.values.tolist(), strict=True))

    def update(t: float, x: Array, u: Array, given: Mapping[str, Any]) -> Array:
        values = [given.get(path, value) for path, value in known.items()]
        M, rest, B = (part.full() for part in equations(x[:n], x[n:], t / T % 1.0, values))
        return np.concatenate([x[n:], np.linalg.solve(M, B @ np.atleast_1d(u) - rest[:, 0])])

    states = [*arm.names, *(coordinate + RATE for coordinate in arm.names)]
    inputs = [arm.names[k] for k in arm.drives[: arm.B.size2()]]
    return control.nlsys(update, None, inputs=inputs or 0, outputs=states, states=states, params=known, name=name)
