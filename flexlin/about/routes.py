"""Two ways from the equations of motion to M_L, D_L, K_L: Jacobians of the residual, and the paper's Kronecker layout."""

from collections.abc import Callable
from functools import partial
from typing import Literal

import casadi as ca

from flexlin.kronecker.symbolic import derivative
from flexlin.mechanics.manipulator import Manipulator

Route = Literal["jacobian", "kronecker"]
Matrices = tuple[ca.SX, ca.SX, ca.SX]


def left_side(arm: Manipulator) -> ca.SX:
    """The residual M s'' + C s' + g + d; where loops are closed, with the symbols v of the joints that follow."""
    return arm.residual if arm.loops is None else arm.loops.residual


def by_jacobian(arm: Manipulator) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M_L, D_L, K_L as Jacobians of the residual by s'', s' and s."""
    jacobian = partial(ca.jacobian, left_side(arm))
    K = jacobian(arm.s) if arm.loops is None else arm.loops.slope(arm.s)
    return jacobian(arm.s_ddot), jacobian(arm.s_dot), K


def by_kronecker(arm: Manipulator) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M_L, D_L, K_L by Eqs (65)-(67) in the Kronecker layout, with the dissipation's slopes added."""
    eye, C = ca.DM.eye(arm.n), arm.C
    by_rate, by_acceleration = ca.kron(arm.s_dot, eye), ca.kron(arm.s_ddot, eye)
    D = C + derivative(C, arm.s_dot) @ by_rate + derivative(arm.damping, arm.s_dot)
    K = (
        derivative(arm.M, arm.s) @ by_acceleration
        + derivative(C, arm.s) @ by_rate
        + derivative(arm.g + arm.damping, arm.s)
    )
    return arm.M, D, K


ROUTES: dict[str, Callable[[Manipulator], Matrices]] = {"jacobian": by_jacobian, "kronecker": by_kronecker}
