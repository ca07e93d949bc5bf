"""Linearization about a periodic motion of the elastic arm, in the place of the rigid one."""

from dataclasses import dataclass

import casadi as ca

from flexlin.about.deviation import Deviation
from flexlin.about.periodic_motion import PeriodicMotion
from flexlin.arguments import checked, instance
from flexlin.checks import Array
from flexlin.periodic.related import extend_system
from flexlin.periodic.system import PeriodicSystem
from flexlin.symbolic import selected


@dataclass(frozen=True, eq=False)
class ElasticCoefficients:
    """M, D, K, B about a periodic motion of the elastic arm, as functions of time (N,).

    `slopes`: all four; `inertia`: M and B alone, for much less work.
    """

    motion: PeriodicMotion
    slopes: ca.Function
    inertia: ca.Function

    def sample(self, function: ca.Function, t: Array) -> tuple[Array, ...]:
        """The outputs of one of the functions at times (N,), in one mapped call."""
        motion = self.motion
        along = (motion.y(t), motion.y(t, 1), motion.y(t, 2), motion.torque(t))
        return motion.lin.about.evaluate(function, t, *along)

    def M(self, t: Array) -> Array:
        return self.sample(self.inertia, t)[0]

    def D(self, t: Array) -> Array:
        return self.sample(self.slopes, t)[1]

    def K(self, t: Array) -> Array:
        return self.sample(self.slopes, t)[2]

    def B(self, t: Array) -> Array:
        return self.sample(self.inertia, t)[1]

    def equations(self, t: Array) -> tuple[Array, Array, Array]:
        M, D, K, _ = self.sample(self.slopes, t)
        return M, D, K


@checked
def linearize_about(motion: PeriodicMotion, closed: bool = True) -> PeriodicSystem:
    """Linearize the equations about a periodic motion of the elastic arm itself.

        M z'' + D z' + K z = B u,   M = d r/d s'',  D = d r/d s',  K = d r/d s,   r = M(s) s'' + C s' + g + d - B(s) torque

    at s = s_R + y of the motion. The motion solves the equations, so nothing is left over on the right side (h = 0), and where
    the links are bent D is not zero even for a single link.

    Parameters
    ----------
    motion : PeriodicMotion
        From `periodic_motion` or from a feedforward.
    closed : bool
        With the scene's feedback, else the arm alone.

    Returns
    -------
    PeriodicSystem
        The system of [z; z'], followed by the states of the loop's controller, with input u the torque beside the motion's.

    Raises
    ------
    SingularMassMatrix
        When M cannot be inverted.

    References
    ----------
    Khang, Dat, Tuan (2019), section 4, with the elastic motion as basic motion.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> elastic = fl.control.linearize_about(fl.control.periodic_motion(lin, tol=1e-6))
    >>> fl.floquet(elastic, tol=1e-6).verdict
    'stable'
    """
    instance("motion", motion, PeriodicMotion, "give what periodic_motion hands back")
    lin = motion.lin
    made = slopes(lin.about)
    c = ElasticCoefficients(motion, made, selected(made, ("M", "B")))
    system = PeriodicSystem.from_second_order(c.M, c.D, c.K, lin.period, c.B, lin.breaks, c.equations)
    law = lin.law
    if not closed:
        return system
    open_loop = system if law.controller is None else extend_system(system, law.controller.rates)
    return open_loop.feedback(law.gain)


def slopes(about: Deviation) -> ca.Function:
    """M, D, K, B about s = s_R + y, as functions of y, y', y'', torque and the place on the motion."""
    arm, kept, driven = about.arm, list(about.kept), list(about.driven)
    *moved, angles = about.symbols()
    torque = ca.SX.sym("torque", about.m)
    inputs = arm.B[:, driven]
    left = arm.residual - inputs @ torque
    parts = [ca.jacobian(left, by)[kept, kept] for by in (arm.s_ddot, arm.s_dot, arm.s)]
    lifted = about.lift([*parts, inputs[kept, :]], angles, *moved)
    named = dict(zip(("y", "y1", "y2", "torque"), [*moved, torque], strict=True))
    return about.function(angles, named, dict(zip("MDKB", lifted, strict=True)))
