"""The equations of the closed loop at many times at once: the nonlinear ones, their linear part, and with rates of a controller."""

from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.linearization.deviation import Deviation, differentiate
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.simulation.mesh import law_times
from flexlin.simulation.modes import Friction, Modes, find_holding, in_modes
from flexlin.simulation.window import Ready

Matrices = tuple[Array, Array, Array]
FEW_SWEEPS = 4
"""What most windows take."""


@dataclass(frozen=True)
class Places:
    """Where a window's stages are: times t (N,), the law's gain (N, m, 2n) and offset (N, m), and the linear equations; n with c.

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
        t, gain, offset, force = (part[which] for part in (self.t, self.gain, self.offset, self.force))
        return Places(t, [part[which] for part in self.place], gain, offset, (M, D, K), force)

    def torque(self, y: Array, v: Array) -> Array:
        """What the law commands, (N, m)."""
        return self.offset - np.einsum("tij,tj->ti", self.gain, np.concatenate([y, v], axis=1))


class LinearEquations:
    """M_L y'' + D_L y' + K_L y = h_L + B_L torque under a law: what the linearization holds of its own law is taken out first.

    The k states z of a controller are the rates of k further coordinates c, c' = z, for an integrator of second-order equations:

        c'' = rates [[y; y'] - reference; c'],     all arrays of the coordinates [y; c]
    """

    def __init__(self, lin: Linearization, law: Law):
        self.lin, self.law, self._own = lin, law, lin.closed_by.direct
        self.n, self.k = lin.n, law.memory

    def places(self, t: Array) -> Places:
        """The coefficients and the law; a law lasts for a period, and after a one-way motion stays as it is at the end."""
        lin, law, own, now = self.lin, self.law, self._own, law_times(self.lin, t)
        c, gain, place = lin.sample(t), law.gain(now), lin.about.place(t)
        offset = law.offset(now, self.known(law, c.tau))
        if law is own:
            return Places(t, place, gain, offset, (c.M, c.D, c.K), c.h)
        at, taken = self.follow(t, place, gain, offset), own.gain(now)
        more = gain - np.pad(taken, ((0, 0), (0, 0), (0, self.k)))
        at.force[:, : self.n] = c.h + np.einsum("tij,tj->ti", c.B, offset - own.offset(now, self.known(own, c.tau)))
        return replace(at, linear=self.extended(at, c.M, c.D, c.K, c.B, self.widened(more)))

    def known(self, law: Law, tau: Array) -> Array | None:
        """The forward part of a law, where it is the torque tau (N, m) of a periodic rigid motion."""
        return tau if self.lin.motion.periodic and law.forward == self.lin.feedforward else None

    def follow(self, t: Array, place: list[Array], gain: Array, offset: Array) -> Places:
        """What a gain (N, m, 2n + k), an offset and the controller do, without the equations of the arm."""
        n, (rates, steer) = self.n, self.rates(t)
        rows = np.zeros((3, len(t), n + self.k, n + self.k))
        rows[0, :, n:, n:], rows[1, :, n:], rows[2, :, n:, :n] = np.eye(self.k), -rates[:, :, n:], -rates[:, :, :n]
        force = np.concatenate([np.zeros((len(t), n)), steer], axis=1)
        return Places(t, place, self.widened(gain), offset, (rows[0], rows[1], rows[2]), force)

    def rates(self, t: Array) -> tuple[Array, Array]:
        """What the states [y; y'; z] and the time alone put into z', (N, k, 2n + k) and (N, k)."""
        controller, steer = self.law.controller, self.law.steer(self.law.reference(law_times(self.lin, t)))
        rates = np.zeros((0, 2 * self.n)) if controller is None else controller.rates
        return np.broadcast_to(rates, (len(t), *rates.shape)), steer

    def widened(self, gain: Array) -> Array:
        """The gain on [y; c; y'; c'], of one on [y; y'; z]."""
        return np.concatenate(
            [gain[:, :, : self.n], np.zeros_like(gain[:, :, 2 * self.n :]), gain[:, :, self.n :]], axis=2
        )

    def extended(self, at: Places, M: Array, D: Array, K: Array, B: Array, gain: Array) -> Matrices:
        """M, D, K of the arm (N, n, n) with a wide gain's part, above the rows of the controller."""
        n, wide, (by_place, by_rate) = self.n, np.array(at.linear), np.split(B @ gain, 2, axis=2)
        wide[1, :, :n], wide[2, :, :n] = by_rate, by_place
        wide[0, :, :n, :n] = M
        wide[1, :, :n, :n] += D
        wide[2, :, :n, :n] += K
        return wide[0], wide[1], wide[2]

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """M w + D v + K y - h."""
        M, D, K = at.linear
        return (M @ w[..., None] + D @ v[..., None] + K @ y[..., None])[..., 0] - at.force

    def power(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """The power (N,) that goes into the arm in a motion of which nothing is left: none is counted."""
        return np.zeros(len(at.t))

    def ready(self, at: Places) -> Ready | None:
        """The residual as compiled code carries it out; None where it takes more than a program, or too few points for one."""
        return None

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """dF/dy'', dF/dy', dF/dy there; None where those of y = 0 are exact."""
        return None


class NonlinearEquations(LinearEquations):
    """M(s) s'' + C s' + g + d = B torque under a law, with s = s_R + y."""

    def __init__(self, lin: Linearization, law: Law, friction: Friction | None = None):
        super().__init__(lin, law)
        self.friction = friction
        self._residual, self._power = loop_functions(lin.about, friction)

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """What is left of the equations of the arm, and of the controller's."""
        arm = self.of_arm(at, y, v, w)
        return np.concatenate([arm, super().residual(at, y, v, w)[:, self.n :]], axis=1) if self.k else arm

    def of_arm(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """M s'' + C s' + g + d - B torque in the coordinates kept."""
        return self.at_places(self._residual, at, y, v, w)[0][:, :, 0]

    def power(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """s' (M s'' + C s' + g)."""
        return self.at_places(self._power, at, y, v, w)[0][:, 0, 0]

    def ready(self, at: Places) -> Ready | None:
        """The program of the residual, once enough points went through it; what a controller adds stands in none."""
        if self.k:
            return None
        program = symbolic.usage_of(self._residual).find_program(len(at.t) * FEW_SWEEPS)
        return None if program is None else Ready(symbolic.lay_out(program, None), at.place)

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices:
        """Exact derivatives, the gain's part included."""
        return self.linearized(at, y, v, w)[0]

    def linearized(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Matrices, Array]:
        """dF/dy'', dF/dy', dF/dy with the gain's part, and F of the arm."""
        M, D, K, B, F = self.at_places(loop_slopes(self.lin.about, self.friction), at, y, v, w)
        return self.extended(at, M, D, K, B, at.gain), F[:, :, 0]

    def at_places(self, function: ca.Function, at: Places, y: Array, v: Array, w: Array) -> list[Array]:
        """The outputs (N, rows, columns) of a function of y, y', y'', the torque and the place."""
        arm = (part[:, : self.n] for part in (y, v, w))
        return symbolic.call(function, [np.ascontiguousarray(part) for part in (*arm, at.torque(y, v), *at.place)])


class ModedEquations(NonlinearEquations):
    """The nonlinear equations of the arm in the present modes, which others change between windows.

    sliding:  M s'' + C s' + g + d + sign F_sliding = B torque;   sticking: s'' = 0 for the joint instead
    """

    def __init__(self, lin: Linearization, law: Law, modes: Modes, friction: Friction | None):
        super().__init__(lin, law, friction)
        self.modes = modes

    def places(self, t: Array) -> Places:
        """What of the law is followed, and the equations about y = 0."""
        law, modes, now, place = self.law, self.modes, law_times(self.lin, t), self.lin.about.place(t)
        if self.friction is not None:
            place.insert(0, np.tile(modes.slip, (len(t), 1)))
        gain, offset = np.where(modes.held[:, None] == 0, law.gain(now), 0.0), modes.given(t, law.offset(now))
        at, rest = self.follow(t, place, gain, offset), np.zeros((len(t), self.n + self.k))
        linear, F = self.linearized(at, rest, rest, rest)
        at.force[:, : self.n] = -F
        return replace(at, linear=linear)

    def rates(self, t: Array) -> tuple[Array, Array]:
        """What the states and the time alone put into z': rates [[y; y'] - reference; z] + unwinding (asked - given)."""
        (rates, steer), law, modes, now = super().rates(t), self.law, self.modes, law_times(self.lin, t)
        if law.controller is None:
            return rates, steer
        unwinding, offset = law.controller.unwinding, law.offset(now)
        missing = (unwinding * (modes.held != 0)) @ law.gain(now)
        return rates - missing, steer + (offset - modes.given(t, offset)) @ unwinding.T


def solve_acceleration(equations: LinearEquations, t: float, y: Array, v: Array) -> tuple[Array, Places]:
    """y'' (n,) at y, y' (n,), in which F is linear: column by column, in units that change F as much as it is; and what holds there."""
    n, at = len(y), equations.places(np.array([t]))
    F = equations.residual(at, y[None], v[None], np.zeros((1, n)))
    unit = (np.abs(F).max() or 1.0) / np.abs(at.linear[0][0]).max(axis=0)
    moved = equations.residual(at.some(np.zeros(n, dtype=int)), np.tile(y, (n, 1)), np.tile(v, (n, 1)), np.diag(unit))
    return -unit * np.linalg.solve((moved - F).T, F[0]), at


@lru_cache(maxsize=8)
def loop_functions(about: Deviation, friction: Friction | None) -> tuple[ca.Function, ca.Function]:
    """F, and the power, as functions of y, y', y'', the torque, the slip of joints that stick, and the place; kept for the next run."""
    inputs, angles, F, power = in_modes(about, friction)
    return about.function(angles, inputs, {"F": F}), about.function(angles, inputs, {"power": power})


@lru_cache(maxsize=8)
def loop_slopes(about: Deviation, friction: Friction | None) -> ca.Function:
    """dF/dy'', dF/dy', dF/dy, -dF/dtorque and F, as functions of the same."""
    inputs, angles, F, _ = in_modes(about, friction)
    return about.function(angles, inputs, {**differentiate(F, inputs), "F": F})


def find_held(about: Deviation, friction: Friction, t: Array, x: Array, torque: Array, slip: Array) -> Array:
    """The friction (N, p) of joints that stick, in states x = [y; y'] (N, 2n) under a torque (N, m), with the slip (N, p) of all."""
    y, v = (np.ascontiguousarray(part) for part in np.split(x, 2, axis=1))
    none = np.zeros_like(y)
    M, *_, F = symbolic.call(loop_slopes(about, friction), [y, v, none, torque, slip, *about.place(t)])
    return find_holding(about, friction, t, (y, v, -np.linalg.solve(M, F)[:, :, 0]), torque)


def to_coordinates(x: Array, n: int) -> Array:
    """States [y; y'; z] (..., 2n + k) as [y; c; y'; c'] with c = 0, (..., 2n + 2k)."""
    return np.concatenate([x[..., :n], np.zeros_like(x[..., 2 * n :]), x[..., n:]], axis=-1)


def from_coordinates(x: Array, n: int, k: int) -> Array:
    """States [y; c; y'; c'] (..., 2n + 2k) as [y; y'; z] (..., 2n + k)."""
    return np.concatenate([x[..., :n], x[..., n + k :]], axis=-1)
