"""Where a disturbance acts and where it is seen: the tip's slopes, the direction across the last link, generalized forces."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.answers.disturbed.stated import Disturbance
from flexlin.checks import Array
from flexlin.control.measurement import tip_position
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.periodic.second_order import build_input

AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Directions:
    """The unit vector e(t) of a force at the tip, or of the deviation that is looked at: a world axis, or across the last rigid link."""

    lin: Linearization
    axis: str = ""

    def unit(self, t: Array) -> Array:
        """e (N, d) along the rigid motion."""
        points = self.lin.about.of_arm("points", t, np.zeros((len(t), self.lin.n)))
        if self.axis:
            if AXES.index(self.axis) >= points.shape[1]:
                raise ArgumentError(
                    "the arm does not move along this axis", got=self.axis, expected=AXES[: points.shape[1]]
                )
            return np.broadcast_to(np.eye(points.shape[1])[AXES.index(self.axis)], points.shape[:2])
        return across(points)

    def seen(self, t: Array, states: Array) -> Array:
        """The tip's deviation along e, (N,) in m, of states (N, 2n or more)."""
        return np.einsum("td,tds,ts->t", self.unit(t), self._slopes(t), states[:, : 2 * self.lin.n])

    def force(self, t: Array) -> Array:
        """The generalized force of 1 N at the tip in the linear equations, (N, n)."""
        return np.einsum("td,tdn->tn", self.unit(t), self._slopes(t)[:, :, : self.lin.n])

    @lazy
    def _slopes(self) -> Callable[[Array], Array]:
        return tip_position(self.lin)

    @lazy
    def exact(self) -> ca.Function:
        """The generalized force of 1 N along e at the deflected tip, as a function of y and the place on the motion; evaluate with e."""
        about = self.lin.about
        arm, (y, *_, angles) = about.arm, about.symbols()
        assert arm.points is not None
        e = ca.SX.sym("e", arm.points.size1())
        slopes = ca.jacobian(arm.points[:, -1], arm.s)[:, list(about.kept)]
        (moved,) = about.lift([slopes], angles, y)
        return about.function(angles, {"y": y, "e": e}, {"force": moved.T @ e})


def across(points: Array) -> Array:
    """The unit vectors (N, d) perpendicular to the last link, in the plane of x and y."""
    last = points[:, :, -1] - points[:, :, -2]
    normal = np.zeros_like(last)
    normal[:, 0], normal[:, 1] = -last[:, 1], last[:, 0]
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal[:, 1] += size[:, 0] == 0
    return normal / np.where(size == 0, 1.0, size)


def disturbing(lin: Linearization, stated: Disturbance) -> Callable[[Array], Array]:
    """How the disturbance of unit size enters x', times (N,) -> (N, 2n or more, 1)."""

    def enters(t: Array) -> Array:
        if stated.kind == "step":
            return lin.input_matrix(t)[:, :, [stated.joint]]
        if stated.kind == "push":
            return build_input(lin.M(t), Directions(lin, stated.axis).force(t)[:, :, None], t)
        return np.zeros((len(t), 2 * lin.n, 1))

    return enters
