"""A one-way motion as a system over its horizon, for designs that end."""

from flexlin.about.linearization import Linearization
from flexlin.periodic.system import PeriodicSystem


def horizon_system(lin: Linearization) -> PeriodicSystem:
    """The linear system of a motion from start to end, its period the duration of the motion.

        M_L y'' + D_L y' + K_L y = B_L u,   0 <= t <= T

    Use it with `finite_horizon_lqr`; repeated beyond T it means nothing unless the motion is periodic. For the transition into rest
    choose a long enough motion (a dwell at its end), since the gain after T is that of the arm at rest.

    Returns: a `PeriodicSystem` that carries the coefficients. Raises: SingularMassMatrix.
    """
    return PeriodicSystem.from_second_order(
        lin.M, lin.D, lin.K, lin.period, lin.B if lin.driven else None, lin.breaks, lin.equations
    )
