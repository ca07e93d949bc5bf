"""Disturbances in words: "joint 1 torque 0.1 N m", "w11=1 cm", "tip 1 N 20 ms", "torque 0.05 N m 100 Hz"."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from flexlin.bounds import LARGEST_NUMBER, SMALLEST_NUMBER
from flexlin.checks import Array
from flexlin.control.export.files import Labels
from flexlin.control.sensors import tip_position
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficients import build_input
from flexlin.scene.units import in_si

AXES = "xyz"


Kind = Literal["step", "initial", "push", "noise"]
PATTERNS = {
    "step": re.compile(r"joint\s+(?P<joint>\d+)\s+torque\s+(?P<size>\S.*)"),
    "push": re.compile(r"tip(\s+(?P<axis>[xyz]))?\s+(?P<size>[-+.\deE]+\s*[mkµu]?N)\s+(?P<time>[-+.\deE]+\s*[mu]?s)"),
    "noise": re.compile(r"torque\s+(?P<size>[-+.\deE]+\s*[a-zA-Z ]+?)\s+(?P<time>[-+.\deE]+\s*k?Hz)"),
}
EXAMPLES = {
    "step": "joint 1 torque 0.1 N m",
    "initial": "w11=1 cm, q1_rate=5 deg/s",
    "push": "tip 1 N 20 ms (across the last link), or tip x 1 N 20 ms",
    "noise": "torque 0.05 N m 100 Hz (root mean square and bandwidth)",
}


@dataclass(frozen=True)
class Disturbance:
    """A disturbance of one of four kinds.

    step: a torque `size` at input `joint` from a phase on; initial: a state `start` (2n,) beside the steady motion;
    push: a force `size` in N at the tip for `time` s, along a world axis or across the last link (axis empty);
    noise: white torques of root mean square `size` within a bandwidth `time` in Hz.
    """

    kind: Kind
    words: str
    size: float = 0.0
    joint: int = 0
    axis: str = ""
    time: float = 0.0
    start: tuple[float, ...] = ()


def state_disturbance(kind: Kind, words: str, lin: Linearization) -> Disturbance:
    """Read a disturbance of a linearization's arm; raises ArgumentError with what was expected."""
    try:
        if kind == "initial":
            return Disturbance(kind, words, start=tuple(read_state(words, lin).tolist()))
        found = PATTERNS[kind].fullmatch(words.strip())
        if found is None:
            raise ValueError(EXAMPLES[kind])
        parts = found.groupdict()
        if kind == "step":
            joint = int(parts["joint"])
            if not 1 <= joint <= lin.about.m:
                raise ValueError(f"a joint from 1 to {lin.about.m}")
            return Disturbance(kind, words, sane_size(parts["size"], lin.input_units[joint - 1]), joint - 1)
        if kind == "push":
            size, time = sane_size(parts["size"], "N"), positive_size(parts["time"], "s")
            return Disturbance(kind, words, size, 0, parts["axis"] or "", time)
        unit = lin.input_units[0] if lin.input_units else "N m"
        return Disturbance(kind, words, positive_size(parts["size"], unit), time=positive_size(parts["time"], "Hz"))
    except ValueError as error:
        raise ArgumentError(f"--{kind} cannot be read", got=repr(words), expected=str(error)) from None


def sane_size(text: str, unit: str, zero: bool = False) -> float:
    """A quantity as a number that other numbers of an arm can be compared with; raises ValueError."""
    value = in_si(text, unit)
    if not (SMALLEST_NUMBER <= abs(value) <= LARGEST_NUMBER or (zero and not value)):
        raise ValueError(f"a number from {SMALLEST_NUMBER:g} to {LARGEST_NUMBER:g} in the place of {text!r}")
    return value


def positive_size(text: str, unit: str) -> float:
    """A quantity greater than 0; raises ValueError."""
    value = sane_size(text, unit)
    if not value > 0:
        raise ValueError(f"a number greater than 0 in the place of {text!r}")
    return value


def read_state(words: str, lin: Linearization) -> Array:
    """A state [y; y'] (2n,) from "name=quantity" pairs."""
    labels, start = Labels.of(lin), np.zeros(2 * lin.n)
    units = dict(zip(labels.states[: len(start)], labels.state_units, strict=False))
    for pair in filter(None, (part.strip() for part in words.split(","))):
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals or name not in units:
            raise ValueError(f"pairs such as {EXAMPLES['initial']}, of {', '.join(units)}")
        start[labels.states.index(name)] = sane_size(value, units[name], zero=True)
    if not start.any():
        raise ValueError(EXAMPLES["initial"])
    return start


@dataclass(frozen=True, eq=False)
class Directions:
    """The unit vector e(t) of a force at the tip, or of the deviation that is looked at: a world axis, or across the last rigid link."""

    lin: Linearization
    axis: str = ""

    def unit(self, t: Array) -> Array:
        """e (N, d) along the rigid motion."""
        points = self.lin.about.near.of_arm("points", t, np.zeros((len(t), self.lin.n)))
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


def disturb(lin: Linearization, stated: Disturbance, t: Array) -> Array:
    """How the disturbance of unit size enters x', times (N,) -> (N, 2n or more, 1)."""
    if stated.kind == "step":
        return lin.input_matrix(t)[:, :, [stated.joint]]
    if stated.kind == "push":
        return build_input(lin.M(t), Directions(lin, stated.axis).force(t)[:, :, None], t)
    return np.zeros((len(t), 2 * lin.n, 1))
