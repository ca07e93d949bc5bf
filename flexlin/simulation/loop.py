"""The nonlinear equations of motion under a torque law, integrated."""

import casadi as ca
import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.linalg.lapack import dposv

from flexlin import symbolic
from flexlin.about.linear import Linearization, along_motion
from flexlin.checks import Array
from flexlin.errors import NumericalError, SingularMassMatrix
from flexlin.motion import SymbolicMotion
from flexlin.simulation.law import Drive, LawTable, TorqueLaw

FARTHEST = 100.0
"""A deviation from the rigid motion, in rad or m, at which a simulation is given up as diverging."""
MOST_CALLS = 1_000_000
"""Evaluations of the equations after which a simulation is given up."""


class NonlinearLoop:
    """The nonlinear equations in the deviation x = [y; y'] from the rigid motion; the last state is the work done on the arm.

    M y'' = B torque - (M s_R'' + C s' + g + d),   work' = s' (M s'' + C s' + g)
    """

    def __init__(self, lin: Linearization, law: TorqueLaw, drive: Drive | None = None):
        self.lin, self.law, self.drive, self.n = lin, LawTable(law, lin), drive or Drive(), lin.n
        self._kept = list(lin.kept)
        self._equations = symbolic.Pointwise(deviation_equations(lin))
        self._calls = 0

    def command(self, t: float, x: Array) -> Array:
        """The torque (m,) that the motors give for the state x = [y; y'] at one time."""
        return self.drive.saturated(self.law(t, x))

    def rate(self, t: float, z: Array, torque: Array) -> Array:
        """The rate of z = [y; y'; work] under a torque."""
        self._calls += 1
        x = z[:-1]
        if self._calls > MOST_CALLS or not np.abs(x[: self.n]).max(initial=0.0) < FARTHEST:
            raise NumericalError(
                f"the nonlinear simulation makes no headway at t = {t:.4g} s",
                got=f"{self._calls} evaluations, a deviation of {np.abs(x[: self.n]).max(initial=0.0):.3g} rad or m",
                todo="the loop diverges or is very stiff: look at its Floquet verdict, or simulate fewer periods",
            )
        M, B, left, rates, lost = self._equations(x, *self._where(t), self.lin.arm.parameters.values)
        kept, left = self._kept, left[:, 0]
        _, acceleration, failed = dposv(M[kept], (B @ torque - left)[kept])
        if failed:
            raise SingularMassMatrix(
                f"the mass matrix is no longer positive definite at t = {t:.4g} s",
                got=f"a deviation of {np.abs(x[: self.n]).max():.3g} rad or m",
                expected="small deflections",
                todo="the loop diverges: look at its Floquet verdict, or simulate fewer periods",
            )
        power = rates[:, 0] @ (left + M @ acceleration) - lost[0, 0]
        return np.concatenate([x[self.n :], acceleration, [power]])

    def integrate(self, t: Array, start: Array, rtol: float) -> Array:
        """States [y; y'; work] (N, 2n + 1) at the times t."""
        z = np.append(start, 0.0)
        if self.drive.sample_time is not None:
            return self._held(t, z, rtol)
        result = solve_ivp(
            lambda t, z: self.rate(t, z, self.command(t, z[:-1])),
            (t[0], t[-1]),
            z,
            "LSODA",
            t,
            rtol=rtol,
            atol=rtol * 1e-2,
        )
        if not result.success:
            raise NumericalError(
                f"the nonlinear simulation stopped at t = {result.t[-1] if len(result.t) else 0:.4g} s",
                got=result.message,
                todo="the loop probably diverges: look at its Floquet verdict, or simulate fewer periods",
            )
        return result.y.T

    def _held(self, t: Array, z: Array, rtol: float) -> Array:
        """Integrate from instant to instant at which the torque changes, sampling measured `delay` before."""
        step, delay = self.drive.sample_time or 1.0, self.drive.delay
        out, torque = np.empty((len(t), len(z))), self.command(t[0], z[:-1])
        out[0], now, done, sample = z, float(t[0]), 1, 0
        while done < len(t):
            measured = t[0] + sample * step
            next_torque = self.command(measured, z[:-1])
            for until, after in ((measured + delay, next_torque), (measured + step, next_torque)):
                if until > now:
                    stops = t[(t > now) & (t <= until + 1e-12 * step)]
                    z, values = self._advance(now, z, until, torque, stops, rtol)
                    out[done : done + len(stops)] = values
                    done, now = done + len(stops), until
                torque = after
            sample += 1
        return out

    def _advance(
        self, begin: float, z: Array, end: float, torque: Array, stops: Array, rtol: float
    ) -> tuple[Array, Array]:
        """Integrate under a constant torque: the state at `end`, and those at the stops on the way."""
        solver = DOP853(
            lambda t, z: self.rate(t, z, torque),
            begin,
            z,
            end,
            rtol=max(rtol, 1e-13),
            atol=rtol * 1e-2,
            first_step=end - begin,
        )
        values = np.empty((len(stops), len(z)))
        while solver.status == "running":
            before = solver.t
            solver.step()
            inside = (stops > before) & (stops <= solver.t + 1e-12 * (end - begin))
            if inside.any():
                values[inside] = solver.dense_output()(np.minimum(stops[inside], solver.t)).T
        if solver.status == "failed":
            raise NumericalError(f"the nonlinear simulation stopped at t = {solver.t:.4g} s", todo="lower the gains")
        return solver.y, values

    def _where(self, t: float) -> list[Array]:
        motion, now = self.lin.motion, np.array([t])
        return (
            [motion.phase_of(now)] if isinstance(motion, SymbolicMotion) else [part[0] for part in motion.sample(now)]
        )


def deviation_equations(lin: Linearization) -> ca.Function:
    """M (all rows, kept columns), B, the residual without y'', the rates s' and the power lost to damping.

    They are functions of x = [y; y'] and the place on the motion, with s = s_R + y.
    """
    arm, kept, driven = lin.arm, list(lin.kept), list(lin.driven)
    select, E = ca.DM.eye(arm.n)[:, kept], arm.reference
    x, angles = ca.SX.sym("x", 2 * lin.n), ca.SX.sym("angles", 3 * arm.joints)
    q, q1, q2 = ca.vertsplit(angles, arm.joints)
    state = ca.densify(ca.vertcat(E @ q + select @ x[: lin.n], E @ q1 + select @ x[lin.n :], E @ q2))
    full, lost = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot), ca.dot(arm.s_dot, arm.damping)
    expressions = [arm.M[:, kept], arm.B[:, driven], arm.residual, arm.s_dot, lost]
    names = ("M", "B", "left", "rates", "lost")
    outputs = dict(zip(names, ca.substitute(expressions, [full], [state]), strict=True))
    return along_motion(arm, lin.motion, angles, {"x": x}, outputs)
