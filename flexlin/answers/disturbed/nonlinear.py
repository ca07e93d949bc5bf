"""The nonlinear answer to a disturbance: one run with it and one without, from the same start."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.about.law import Law, VectorFunction
from flexlin.about.linearization import Linearization
from flexlin.answers.disturbed.directions import Directions
from flexlin.answers.disturbed.stated import Disturbance
from flexlin.checks import Array
from flexlin.simulation.drive import Drive
from flexlin.simulation.equations import NonlinearEquations, Places
from flexlin.simulation.loop import NonlinearLoop


class PushedEquations(NonlinearEquations):
    """The nonlinear equations with a force `size` at the tip, in N."""

    def __init__(self, lin: Linearization, law: Law, directions: Directions, size: float):
        super().__init__(lin, law)
        self._directions, self._size = directions, size

    def push(self, t: Array, y: Array) -> Array:
        """The generalized force (N, n)."""
        e = self._directions.unit(t)
        return self._size * self.lin.about.evaluate(self._directions.exact, t, y, e)[0][:, :, 0]

    def residual(self, at: Places, y: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """M s'' + C s' + g + d - B torque - J' force in the coordinates kept."""
        F, power = super().residual(at, y, v, w)
        return F - self.push(at.t, y), power


class PushedLoop(NonlinearLoop):
    """A nonlinear loop with a constant force at the tip."""

    def __init__(self, lin: Linearization, law: Law, directions: Directions, size: float):
        super().__init__(lin, law, Drive())
        self.friction = None
        self._pushing = directions, size

    def _equations_under(self, law: Law) -> NonlinearEquations:
        return PushedEquations(self.lin, law, *self._pushing)


@dataclass(frozen=True, eq=False)
class Shifted:
    """A torque function with a constant added to one input."""

    forward: VectorFunction
    joint: int
    size: float

    def __call__(self, t: Array) -> Array:
        torque = np.array(self.forward(t))
        torque[:, self.joint] += self.size
        return torque


def answer_nonlinearly(
    lin: Linearization, law: Law, drive: Drive, stated: Disturbance, begin: float, t: Array, start: Array, tol: float
) -> tuple[Array, Array]:
    """States (S, 2n + k) with and without the disturbance at times t (S,) after `begin`, from the steady state `start` (2n + k,)."""
    moments = begin + t
    without = NonlinearLoop(lin, law, drive).integrate(moments, start, tol)[:, :-1]
    if stated.kind == "initial":
        away = np.append(stated.start, np.zeros(len(start) - len(stated.start)))
        return NonlinearLoop(lin, law, drive).integrate(moments, start + away, tol)[:, :-1], without
    if stated.kind == "step":
        shifted = replace(law, forward=Shifted(law.forward, stated.joint, stated.size))
        return NonlinearLoop(lin, shifted, drive).integrate(moments, start, tol)[:, :-1], without
    until = int(np.searchsorted(t, stated.time * (1 + 1e-12), side="right"))
    pushed = PushedLoop(lin, law, Directions(lin, stated.axis), stated.size).integrate(moments[:until], start, tol)[
        :, :-1
    ]
    after = NonlinearLoop(lin, law, drive).integrate(moments[until - 1 :], pushed[-1], tol)[1:, :-1]
    return np.concatenate([pushed, after]), without
