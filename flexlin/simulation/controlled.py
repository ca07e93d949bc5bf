"""The equations of a loop whose controller has states of its own: they ride along as rates of further coordinates."""

from dataclasses import dataclass

import numpy as np

from flexlin.about.law import Law
from flexlin.checks import Array
from flexlin.simulation.equations import Equations, LinearEquations, Matrices, Places
from flexlin.simulation.window import Ready


@dataclass(frozen=True)
class ControlledPlaces(Places):
    """As `Places`, in the coordinates [y; c] with c' = z.

    of_arm: the places of the arm alone; by_states: the gain (N, m, k) on z; of_states: what it does in the linear equations (N, n, k).
    """

    of_arm: Places
    by_states: Array
    of_states: Array

    def some(self, which: Array | slice) -> "ControlledPlaces":
        """The same at some of the times."""
        some, arm = super().some(which), self.of_arm.some(which)
        own = self.by_states[which], self.of_states[which]
        return ControlledPlaces(some.t, some.place, some.gain, some.offset, some.linear, some.force, arm, *own)


class ControlledEquations:
    """The equations of the arm with a controller, in the coordinates [y; c], c' = z.

        F(t, y, y', y'') = B (torque - gain_z c'),   c'' = rates [[y; y'] - reference; c']

    c itself stands nowhere: it lets an integrator of second-order equations carry z. `arm`: the equations under `law.direct`.
    """

    def __init__(self, arm: LinearEquations, law: Law):
        assert law.controller is not None
        self._arm, self._law, self._n, self._controller = arm, law, arm.lin.n, law.controller

    def places(self, t: Array) -> ControlledPlaces:
        """The coefficients, with rows and columns for c."""
        at, lin, n = self._arm.places(t), self._arm.lin, self._n
        now = t % lin.period if lin.motion.periodic else np.minimum(t, lin.period)
        gain = self._law.gain(now)
        B, by_states = lin.mass_and_input(t)[1], gain[:, :, 2 * n :]
        of_states = B @ by_states
        force = np.concatenate([at.force, self._law.steer(self._law.reference(now))], axis=1)
        linear = self.extended(*at.linear, of_states)
        return ControlledPlaces(t, at.place, self.widened(gain), at.offset, linear, force, at, by_states, of_states)

    def widened(self, gain: Array) -> Array:
        """The gain (N, m, 2n + k) in the coordinates [y; c; y'; c']."""
        n, none = self._n, np.zeros((*gain.shape[:2], self._controller.states))
        return np.concatenate([gain[:, :, :n], none, gain[:, :, n:]], axis=2)

    def extended(self, M: Array, D: Array, K: Array, of_states: Array) -> Matrices:
        """M, D, K (N, n, n) with rows and columns for c; of_states (N, n, k): the force of z."""
        n, k, rates = self._n, self._controller.states, self._controller.rates
        wide = np.zeros((3, len(M), n + k, n + k))
        wide[0, :, :n, :n], wide[1, :, :n, :n], wide[2, :, :n, :n] = M, D, K
        wide[0, :, n:, n:] = np.eye(k)
        wide[1, :, :n, n:], wide[1, :, n:] = of_states, -rates[:, n:]
        wide[2, :, n:, :n] = -rates[:, :n]
        return wide[0], wide[1], wide[2]

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """What is left of the equations, and the power that goes into the arm."""
        assert isinstance(at, ControlledPlaces)
        n, rates, arm = self._n, self._controller.rates, self.moved(at, v)
        F, power = self._arm.residual(arm, *(np.ascontiguousarray(part[:, :n]) for part in (y, v, w)))
        of_states = w[:, n:] - np.concatenate([y[:, :n], v], axis=1) @ rates.T - at.force[:, n:]
        return np.concatenate([F, of_states], axis=1), power

    def ready(self, at: Places) -> Ready | None:
        """None: what the controller adds stands in no program."""
        return None

    def mass(self, at: Places, y: Array) -> Array:
        """That of the arm; rates z' stand alone."""
        assert isinstance(at, ControlledPlaces)
        n, k = self._n, self._controller.states
        wide = np.zeros((len(y), n + k, n + k))
        wide[:, :n, :n], wide[:, n:, n:] = self._arm.mass(at.of_arm, y[:, :n]), np.eye(k)
        return wide

    def slopes(self, at: Places, y: Array, v: Array, w: Array) -> Matrices | None:
        """Derivatives where the arm is, with the input matrix of the rigid motion; none where those of the arm are the linear ones."""
        assert isinstance(at, ControlledPlaces)
        n = self._n
        found = self._arm.slopes(self.moved(at, v), y[:, :n], v[:, :n], w[:, :n])
        return None if found is None else self.extended(*found, at.of_states)

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
