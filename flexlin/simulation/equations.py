"""The equations of the closed loop at many times at once: the nonlinear ones, their linear part, and with rates of a controller."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.linearization.deviation import Deviation
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.simulation.mesh import law_times
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

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """F (N, n)."""

    def power(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """The power (N,) that goes into the arm in a motion of which nothing is left in F."""

    def ready(self, at: Places) -> Ready | None:
        """The residual as compiled code carries it out; None where it takes more than a program, or too few points for one."""

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """dF/dy'', dF/dy', dF/dy (N, n, n) there; None where those of y = 0 are exact."""


class LinearEquations:
    """M_L y'' + D_L y' + K_L y = h_L + B_L torque under a law: what the linearization holds of its own law is taken out first."""

    def __init__(self, lin: Linearization, law: Law):
        self.lin, self.law, self._own = lin, law, lin.closed_by.direct

    def places(self, t: Array) -> Places:
        """The coefficients and the law; a law lasts for a period, and after a one-way motion stays as it is at the end."""
        lin, law, own, n, now = self.lin, self.law, self._own, self.lin.n, law_times(self.lin, t)
        c, gain, place = lin.sample(t), law.gain(now), lin.about.place(t)
        offset = self._forward(law, now, c.tau) + np.einsum("tij,tj->ti", gain, law.reference(now))
        if law is own:
            return Places(t, place, gain, offset, (c.M, c.D, c.K), c.h)
        taken = own.gain(now)
        added = c.B @ (gain - taken)
        other = self._forward(own, now, c.tau) + np.einsum("tij,tj->ti", taken, own.reference(now))
        force = c.h + np.einsum("tij,tj->ti", c.B, offset - other)
        return Places(t, place, gain, offset, (c.M, c.D + added[:, :, n:], c.K + added[:, :, :n]), force)

    def input_matrix(self, at: Places) -> Array:
        """B (N, n, m) of the rigid motion."""
        return self.lin.mass_and_input(at.t)[1]

    def _forward(self, law: Law, t: Array, tau: Array) -> Array:
        """The law's forward part (N, m); that of the rigid motion is known already where the motion is periodic."""
        known = self.lin.motion.periodic and law.forward == self.lin.feedforward
        return tau if known else law.forward(t)

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """M w + D v + K y - h."""
        M, D, K = at.linear
        return (M @ w[..., None] + D @ v[..., None] + K @ y[..., None])[..., 0] - at.force

    def power(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """None is counted."""
        return np.zeros(len(at.t))

    def ready(self, at: Places) -> Ready | None:
        """None: these need no program."""
        return None

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """The linear equations are their own."""
        return None


class NonlinearEquations(LinearEquations):
    """M(s) s'' + C s' + g + d = B torque under a law, with s = s_R + y."""

    def __init__(self, lin: Linearization, law: Law):
        super().__init__(lin, law)
        self._residual, self._power = loop_functions(lin.about)

    @lazy
    def _slopes(self) -> ca.Function:
        return loop_slopes(self.lin.about)

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """M s'' + C s' + g + d - B torque in the coordinates kept."""
        return self.at_places(self._residual, at, y, v, w)[0][:, :, 0]

    def power(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """s' (M s'' + C s' + g)."""
        return self.at_places(self._power, at, y, v, w)[0][:, 0, 0]

    def ready(self, at: Places) -> Ready | None:
        """The program of the residual, once enough points went through it."""
        program = symbolic.usage_of(self._residual).find_program(len(at.t) * FEW_SWEEPS)
        return None if program is None else Ready(symbolic.lay_out(program, None), at.place)

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices:
        """Exact derivatives, the gain's part included."""
        n = self.lin.n
        M, D, K, B = self.at_places(self._slopes, at, y, v, w)
        added = B @ at.gain
        return M, D + added[:, :, n:], K + added[:, :, :n]

    def at_places(self, function: ca.Function, at: Places, y: Array, v: Array, w: Array) -> list[Array]:
        """The outputs (N, rows, columns) of a function of y, y', y'', the torque and the place."""
        inputs = (y, v, w, at.torque(y, v), *at.place)
        return symbolic.call(function, [np.ascontiguousarray(part) for part in inputs])


def solve_acceleration(equations: Equations, t: float, y: Array, v: Array) -> tuple[Array, Places]:
    """y'' (n,) at y, y' (n,), in which F is linear: column by column, in units that change F as much as it is; and what holds there."""
    n, at = len(y), equations.places(np.array([t]))
    F = equations.residual(at, y[None], v[None], np.zeros((1, n)))
    unit = (np.abs(F).max() or 1.0) / np.abs(at.linear[0][0]).max(axis=0)
    moved = equations.residual(at.some(np.zeros(n, dtype=int)), np.tile(y, (n, 1)), np.tile(v, (n, 1)), np.diag(unit))
    return -unit * np.linalg.solve((moved - F).T, F[0]), at


def loop_expressions(about: Deviation) -> tuple[dict[str, ca.SX], ca.SX, ca.SX, ca.SX, ca.SX]:
    """The inputs y, y', y'', torque; the angles; F of the coordinates kept; B; the power where F = 0.

    power = s' (M s'' + C s' + g), in whose rows of coordinates kept B torque - d stands for the inertial forces.
    """
    arm, kept = about.arm, list(about.kept)
    y, rate, acceleration, angles = about.symbols()
    torque = ca.SX.sym("torque", about.m)
    driven = arm.B[:, list(about.driven)]
    balance = ca.SX(arm.residual)
    balance[kept] = (driven @ torque)[kept]
    expressions = [arm.residual, driven, ca.dot(arm.s_dot, balance - arm.damping)]
    left, B, power = about.lift(expressions, angles, y, rate, acceleration)
    inputs = {"y": y, "y1": rate, "y2": acceleration, "torque": torque}
    return inputs, angles, (left - B @ torque)[kept], B[kept, :], power


@lru_cache(maxsize=8)
def loop_functions(about: Deviation) -> tuple[ca.Function, ca.Function]:
    """F, and the power, as functions of y, y', y'', the torque and the place on the motion; kept for the next run."""
    inputs, angles, F, _, power = loop_expressions(about)
    return about.function(angles, inputs, {"F": F}), about.function(angles, inputs, {"power": power})


@lru_cache(maxsize=8)
def loop_slopes(about: Deviation) -> ca.Function:
    """The Jacobians of F by y'', y' and y, and B; kept for the next run."""
    inputs, angles, F, B, _ = loop_expressions(about)
    slopes = {name: ca.jacobian(F, inputs[by]) for name, by in (("M", "y2"), ("D", "y1"), ("K", "y"))}
    return about.function(angles, inputs, {**slopes, "B": B})


@dataclass(frozen=True)
class ControlledPlaces(Places):
    """As `Places`, in the coordinates [y; c] with c' = z.

    of_arm: the places of the arm alone; by_states: the gain (N, m, k) on z; of_states: what it does in the linear equations (N, n, k);
    rates: what [y; y'; z] puts into z', (N, k, 2n + k).
    """

    of_arm: Places
    by_states: Array
    of_states: Array
    rates: Array

    def some(self, which: Array | slice) -> "ControlledPlaces":
        """The same at some of the times."""
        some, arm = super().some(which), self.of_arm.some(which)
        own = self.by_states[which], self.of_states[which], self.rates[which]
        return ControlledPlaces(some.t, some.place, some.gain, some.offset, some.linear, some.force, arm, *own)


class ControlledEquations:
    """The equations of the arm with a controller, in the coordinates [y; c], c' = z.

        F(t, y, y', y'') = B (torque - gain_z c'),   c'' = rates [[y; y'] - reference; c']

    c itself stands nowhere: it lets an integrator of second-order equations carry z. `arm`: the equations under `law.direct`.
    """

    def __init__(self, arm: LinearEquations, law: Law):
        assert law.controller is not None
        self._arm, self._law, self._n, self._controller = arm, law, arm.lin.n, law.controller

    def rates(self, t: Array) -> tuple[Array, Array]:
        """What the states [y; y'; z] and the time alone put into z', (N, k, 2n + k) and (N, k)."""
        rates, steer = self._controller.rates, self._law.steer(self._law.reference(law_times(self._arm.lin, t)))
        return np.broadcast_to(rates, (len(t), *rates.shape)), steer

    def steering(self, t: Array) -> Array:
        """The gain on z, (N, m, k)."""
        return self._law.gain(law_times(self._arm.lin, t))[:, :, 2 * self._n :]

    def places(self, t: Array) -> ControlledPlaces:
        """The coefficients, with rows and columns for c."""
        at, by_states, (rates, steer) = self._arm.places(t), self.steering(t), self.rates(t)
        of_states = self._arm.input_matrix(at) @ by_states
        force, linear = np.concatenate([at.force, steer], axis=1), self.extended(*at.linear, of_states, rates)
        gain = self.widened(at.gain, by_states)
        return ControlledPlaces(t, at.place, gain, at.offset, linear, force, at, by_states, of_states, rates)

    def widened(self, gain: Array, by_states: Array) -> Array:
        """The gain on [y; c; y'; c'], of that on [y; y'] (N, m, 2n) and that on z."""
        return np.concatenate(
            [gain[:, :, : self._n], np.zeros_like(by_states), gain[:, :, self._n :], by_states], axis=2
        )

    def extended(self, M: Array, D: Array, K: Array, of_states: Array, rates: Array) -> Matrices:
        """M, D, K (N, n, n) with rows and columns for c; of_states (N, n, k): the force of z; rates (N, k, 2n + k)."""
        n, k = self._n, self._controller.states
        wide = np.zeros((3, len(M), n + k, n + k))
        wide[0, :, :n, :n], wide[1, :, :n, :n], wide[2, :, :n, :n] = M, D, K
        wide[0, :, n:, n:] = np.eye(k)
        wide[1, :, :n, n:], wide[1, :, n:] = of_states, -rates[:, :, n:]
        wide[2, :, n:, :n] = -rates[:, :, :n]
        return wide[0], wide[1], wide[2]

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """What is left of the equations."""
        assert isinstance(at, ControlledPlaces)
        n = self._n
        F = self._arm.residual(self.moved(at, v), y[:, :n], v[:, :n], w[:, :n])
        driven = np.einsum("tij,tj->ti", at.rates, np.concatenate([y[:, :n], v], axis=1))
        return np.concatenate([F, w[:, n:] - driven - at.force[:, n:]], axis=1)

    def power(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """That into the arm."""
        assert isinstance(at, ControlledPlaces)
        n = self._n
        return self._arm.power(self.moved(at, v), y[:, :n], v[:, :n], w[:, :n])

    def ready(self, at: Places) -> Ready | None:
        """None: what the controller adds stands in no program."""
        return None

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """Derivatives where the arm is, with the input matrix of the rigid motion; none where those of the arm are the linear ones."""
        assert isinstance(at, ControlledPlaces)
        n = self._n
        found = self._arm.slopes(self.moved(at, v), y[:, :n], v[:, :n], w[:, :n])
        return None if found is None else self.extended(*found, at.of_states, at.rates)

    def moved(self, at: ControlledPlaces, v: Array) -> Places:
        """The places of the arm alone, with what z gives in the offset of the torque and in the force."""
        arm, z = at.of_arm, v[:, self._n :]
        offset = arm.offset - np.einsum("tij,tj->ti", at.by_states, z)
        force = arm.force - np.einsum("tij,tj->ti", at.of_states, z)
        return Places(arm.t, arm.place, arm.gain, offset, arm.linear, force)


def with_controller(arm: LinearEquations, law: Law) -> Equations:
    """The equations under a law: those of the arm under its direct part, and what it remembers beside them."""
    return arm if law.controller is None else ControlledEquations(arm, law)


def to_coordinates(x: Array, n: int) -> Array:
    """States [y; y'; z] (..., 2n + k) as [y; c; y'; c'] with c = 0, (..., 2n + 2k)."""
    return np.concatenate([x[..., :n], np.zeros_like(x[..., 2 * n :]), x[..., n:]], axis=-1)


def from_coordinates(x: Array, n: int, k: int) -> Array:
    """States [y; c; y'; c'] (..., 2n + 2k) as [y; y'; z] (..., 2n + k)."""
    return np.concatenate([x[..., :n], x[..., n + k :]], axis=-1)
