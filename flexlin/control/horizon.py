"""A one-way motion as a system over its horizon, for designs that end."""

from flexlin.about.linearization import Linearization
from flexlin.arguments import checked
from flexlin.periodic.system import PeriodicSystem


@checked
def horizon_system(lin: Linearization) -> PeriodicSystem:
    """Return the linear system of a motion from start to end; its period is the duration of the motion.

        M_L y'' + D_L y' + K_L y = B_L u,   0 <= t <= T

    Use it with `finite_horizon_lqr`. Repeated beyond T it means nothing unless the motion is periodic. For the transition into rest
    choose a long enough motion (a dwell at its end), since the gain after T is that of the arm at rest.

    Parameters
    ----------
    lin : Linearization
        Of a one-way or a periodic motion.

    Returns
    -------
    PeriodicSystem
        The system in x = [y; y'], with the coefficients of the second-order equations.

    Raises
    ------
    SingularMassMatrix
        When M_L cannot be inverted.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("pick-and-place", {"motion.course": "one-way"})
    >>> system = fl.control.horizon_system(fl.linearize(fl.build_manipulator(scene), scene.motion))
    >>> system.n, system.m, system.period
    (10, 2, 1.0)
    """
    return PeriodicSystem.from_second_order(
        lin.M, lin.D, lin.K, lin.period, lin.B if lin.driven else None, lin.breaks, lin.equations
    )
