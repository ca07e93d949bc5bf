"""The equations of the closed loop at many times at once: the nonlinear ones, and their linear part."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.deviation import Deviation
from flexlin.about.law import Law
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.simulation.window import Ready

Matrices = tuple[Array, Array, Array]
FEW_SWEEPS = 4
"""What most windows take."""


@dataclass(frozen=True)
class Places:
    """Where a window's stages are: times t (N,), the law's gain (N, m, 2n) and offset (N, m), and the linear equations.

    place: what functions take of the motion there, and the parameters; linear: M, D, K (N, n, n); force: (N, n), what is left of the
    equations at y = 0.
    """

    t: Array
    place: list[Array]
    gain: Array
    offset: Array
    linear: Matrices
    force: Array

    def some(self, which: Array | slice) -> "Places":
        """The same at some of the times."""
        M, D, K = (A[which] for A in self.linear)
        return Places(
            self.t[which],
            [part[which] for part in self.place],
            self.gain[which],
            self.offset[which],
            (M, D, K),
            self.force[which],
        )

    def torque(self, y: Array, v: Array) -> Array:
        """What the law commands, (N, m)."""
        return self.offset - np.einsum("tij,tj->ti", self.gain, np.concatenate([y, v], axis=1))


class Equations(Protocol):
    """Equations F(t, y, y', y'') = 0 at many times, as the collocation asks for them."""

    def places(self, t: Array) -> Places:
        """All that depends on the times alone."""

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """F (N, n), and the power (N,) that goes into the arm."""

    def ready(self, at: Places) -> Ready | None:
        """The residual as compiled code carries it out; None where it takes more than a program, or too few points for one."""

    def mass(self, at: Places, y: Array) -> Array:
        """dF/dy'' (N, n, n), for much less work than all slopes."""

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """dF/dy'', dF/dy', dF/dy (N, n, n) there; None where those of y = 0 are exact."""


class LinearEquations:
    """M_L y'' + D_L y' + K_L y = h_L + B_L torque under a law: what the linearization holds of its own law is taken out first."""

    def __init__(self, lin: Linearization, law: Law):
        self.lin, self.law, self._own = lin, law, lin.closed_by.direct

    def places(self, t: Array) -> Places:
        """The coefficients and the law; a law lasts for a period, and after a one-way motion stays as it is at the end."""
        lin, law, own, n = self.lin, self.law, self._own, self.lin.n
        now = t % lin.period if lin.motion.periodic else np.minimum(t, lin.period)
        c, gain, place = lin.sample(t), law.gain(now), lin.about.place(t)
        offset = self._forward(law, now, c.tau) + np.einsum("tij,tj->ti", gain, law.reference(now))
        if law is own:
            return Places(t, place, gain, offset, (c.M, c.D, c.K), c.h)
        taken = own.gain(now)
        added = c.B @ (gain - taken)
        other = self._forward(own, now, c.tau) + np.einsum("tij,tj->ti", taken, own.reference(now))
        force = c.h + np.einsum("tij,tj->ti", c.B, offset - other)
        return Places(t, place, gain, offset, (c.M, c.D + added[:, :, n:], c.K + added[:, :, :n]), force)

    def _forward(self, law: Law, t: Array, tau: Array) -> Array:
        """The law's forward part (N, m); that of the rigid motion is known already where the motion is periodic."""
        known = self.lin.motion.periodic and law.forward == self.lin.feedforward
        return tau if known else law.forward(t)

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """M w + D v + K y - h."""
        M, D, K = at.linear
        F = (M @ w[..., None] + D @ v[..., None] + K @ y[..., None])[..., 0] - at.force
        return F, np.zeros(len(at.t))

    def ready(self, at: Places) -> Ready | None:
        """None: these need no program."""
        return None

    def mass(self, at: Places, y: Array) -> Array:
        """M of the rigid motion, wherever the arm is."""
        return at.linear[0]

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """The linear equations are their own."""
        return None


class NonlinearEquations(LinearEquations):
    """M(s) s'' + C s' + g + d = B torque under a law, with s = s_R + y; power = s' (M s'' + C s' + g)."""

    def __init__(self, lin: Linearization, law: Law):
        super().__init__(lin, law)
        self._residual = loop_residual(lin.about)

    @lazy
    def _slopes(self) -> ca.Function:
        return loop_slopes(self.lin.about)

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """M s'' + C s' + g + d - B torque in the coordinates kept."""
        F, power = symbolic.call(self._residual, [y, v, w, at.torque(y, v), *at.place])
        return F[:, :, 0], power[:, 0, 0]

    def ready(self, at: Places) -> Ready | None:
        """The program of the residual, once enough points went through it."""
        program = symbolic.usage_of(self._residual).find_program(len(at.t) * FEW_SWEEPS)
        return None if program is None else Ready(symbolic.lay_out(program, None), at.place)

    def mass(self, at: Places, y: Array) -> Array:
        """M at s = s_R + y, in the coordinates kept."""
        kept = list(self.lin.kept)
        return self.lin.about.of_arm("M", at.t, y)[:, kept][:, :, kept]

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """Exact derivatives, the gain's part included."""
        n = self.lin.n
        inputs = [np.ascontiguousarray(part) for part in (y, v, w, at.torque(y, v), *at.place)]
        M, D, K, B = symbolic.call(self._slopes, inputs)
        added = B @ at.gain
        return M, D + added[:, :, n:], K + added[:, :, :n]


def loop_expressions(about: Deviation) -> tuple[dict[str, ca.SX], ca.SX, ca.SX, ca.SX, ca.SX]:
    """The inputs y, y', y'', torque; the angles; F of the coordinates kept; B; the power."""
    arm, kept = about.arm, list(about.kept)
    y, rate, acceleration, angles = about.symbols()
    torque = ca.SX.sym("torque", about.m)
    expressions = [arm.residual, arm.B[:, list(about.driven)], ca.dot(arm.s_dot, arm.residual - arm.damping)]
    left, B, power = about.lift(expressions, angles, y, rate, acceleration)
    inputs = {"y": y, "y1": rate, "y2": acceleration, "torque": torque}
    return inputs, angles, (left - B @ torque)[kept], B[kept, :], power


@lru_cache(maxsize=8)
def loop_residual(about: Deviation) -> ca.Function:
    """F and the power as a function of y, y', y'', the torque and the place on the motion; kept for the next run."""
    inputs, angles, F, _, power = loop_expressions(about)
    return about.function(angles, inputs, {"F": F, "power": power})


@lru_cache(maxsize=8)
def loop_slopes(about: Deviation) -> ca.Function:
    """The Jacobians of F by y'', y' and y, and B; kept for the next run."""
    inputs, angles, F, B, _ = loop_expressions(about)
    slopes = {name: ca.jacobian(F, inputs[by]) for name, by in (("M", "y2"), ("D", "y1"), ("K", "y"))}
    return about.function(angles, inputs, {**slopes, "B": B})


def deviation_equations(about: Deviation) -> ca.Function:
    """M (all rows, kept columns), B, the residual without y'', the rates s' and the power lost to damping.

    They are functions of x = [y; y'] and the place on the motion, with s = s_R + y.
    """
    arm, n = about.arm, about.n
    x, (*_, angles) = ca.SX.sym("x", 2 * n), about.symbols()
    lost = ca.dot(arm.s_dot, arm.damping)
    expressions = [arm.M[:, list(about.kept)], arm.B[:, list(about.driven)], arm.residual, arm.s_dot, lost]
    values = about.lift(expressions, angles, x[:n], x[n:])
    return about.function(angles, {"x": x}, dict(zip(("M", "B", "left", "rates", "lost"), values, strict=True)))
