"""The equations of the closed loop at many times at once: the nonlinear ones, and their linear part."""

from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from flexlin.about.deviation import Deviation
from flexlin.about.law import Law
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.lazy import lazy

Matrices = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Places:
    """Where a window's stages are: times t (N,), the law's gain (N, m, 2n) and offset (N, m), and the linear equations.

    linear: M, D, K (N, n, n); force: (N, n), what is left of the equations at y = 0.
    """

    t: Array
    gain: Array
    offset: Array
    linear: Matrices
    force: Array

    def some(self, which: Array) -> "Places":
        """The same at some of the times."""
        M, D, K = (A[which] for A in self.linear)
        return Places(self.t[which], self.gain[which], self.offset[which], (M, D, K), self.force[which])

    def torque(self, y: Array, v: Array) -> Array:
        """What the law commands, (N, m)."""
        return self.offset - np.einsum("tij,tj->ti", self.gain, np.concatenate([y, v], axis=1))


class Equations(Protocol):
    """Equations F(t, y, y', y'') = 0 at many times, as the collocation asks for them."""

    def places(self, t: Array) -> Places:
        """All that depends on the times alone."""

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """F (N, n), and the power (N,) that goes into the arm."""

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
        lin, n = self.lin, self.lin.n
        now = t % lin.period if lin.motion.periodic else np.minimum(t, lin.period)
        c, gain, own = lin.sample(t), self.law.gain(now), self._own.gain(now)
        added = c.B @ (gain - own)
        offset = self._forward(self.law, now, c.tau) + np.einsum("tij,tj->ti", gain, self.law.reference(now))
        taken = self._forward(self._own, now, c.tau) + np.einsum("tij,tj->ti", own, self._own.reference(now))
        force = c.h + np.einsum("tij,tj->ti", c.B, offset - taken)
        return Places(t, gain, offset, (c.M, c.D + added[:, :, n:], c.K + added[:, :, :n]), force)

    def _forward(self, law: Law, t: Array, tau: Array) -> Array:
        """The law's forward part (N, m); that of the rigid motion is known already where the motion is periodic."""
        known = self.lin.motion.periodic and law.forward == self.lin.feedforward
        return tau if known else law.forward(t)

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """M w + D v + K y - h."""
        M, D, K = at.linear
        F = (M @ w[..., None] + D @ v[..., None] + K @ y[..., None])[..., 0] - at.force
        return F, np.zeros(len(at.t))

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
        F, power = self.lin.about.evaluate(self._residual, at.t, y, v, w, at.torque(y, v))
        return F[:, :, 0], power[:, 0, 0]

    def mass(self, at: Places, y: Array) -> Array:
        """M at s = s_R + y, in the coordinates kept."""
        kept = list(self.lin.kept)
        return self.lin.about.of_arm("M", at.t, y)[:, kept][:, :, kept]

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """Exact derivatives, the gain's part included."""
        n = self.lin.n
        M, D, K, B = self.lin.about.evaluate(self._slopes, at.t, y, v, w, at.torque(y, v))
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


def loop_residual(about: Deviation) -> ca.Function:
    """F and the power as a function of y, y', y'', the torque and the place on the motion."""
    inputs, angles, F, _, power = loop_expressions(about)
    return about.function(angles, inputs, {"F": F, "power": power})


def loop_slopes(about: Deviation) -> ca.Function:
    """The Jacobians of F by y'', y' and y, and B."""
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
