"""What commands the torque of a simulation, and what the drive makes of the command."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from flexlin.about.linear import Linearization
from flexlin.about.periodic_motion import default_closing, own_gain, rigid_feedforward
from flexlin.checks import Array
from flexlin.control.tracking import Feedforward
from flexlin.errors import ArgumentError
from flexlin.periodic.system import MatrixFunction

POINTS = 2048
"""Knots of a tabulated law in one period: a tenth harmonic is met to 1e-9 of its size."""


@dataclass(frozen=True)
class TorqueLaw:
    """torque = forward(t) - gain(t) ([y; y'] - reference(t)): times (N,) -> (N, m), (N, m, 2n), (N, 2n)."""

    forward: Callable[[Array], Array]
    gain: MatrixFunction
    reference: Callable[[Array], Array]


class LawTable:
    """A torque law by cubic splines, f(t) - K(t) x: integrators ask for it at one time after another."""

    def __init__(self, law: TorqueLaw, lin: Linearization):
        self._period = lin.period if lin.motion.periodic else np.inf
        marks = np.unique([0.0, *lin.breaks, lin.period])
        pieces = []
        for begin, end in pairwise(marks):
            points = max(8, int(POINTS * (end - begin) / lin.period))
            t = np.linspace(begin, end, points + 1)
            inside = np.clip(t, begin + 1e-12 * lin.period, end - 1e-12 * lin.period)
            gain = law.gain(inside)
            constant = law.forward(inside) + np.einsum("tij,tj->ti", gain, law.reference(inside))
            pieces.append(CubicSpline(t, np.concatenate([constant[:, :, None], -gain], axis=2), axis=0))
        self._spline = PPoly(
            np.concatenate([piece.c for piece in pieces], axis=1),
            np.concatenate([*[piece.x[:-1] for piece in pieces], marks[-1:]]),
        )

    def __call__(self, t: float, x: Array) -> Array:
        """The torque (m,) at one time."""
        values = self._spline(t % self._period)
        return values[:, 0] + values[:, 1:] @ x


@dataclass(frozen=True)
class Drive:
    """What stands between the commanded torque and the joint; each part is off unless it is given.

    limit: (m,) largest |torque| in N m; sample_time in s: the command is computed once in each interval and held (zero-order hold);
    delay in s: between measuring and the torque taking effect, below one sample time.
    """

    limit: tuple[float, ...] | None = None
    sample_time: float | None = None
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name, values in (
            ("limit", self.limit or ()),
            ("sample_time", (self.sample_time,) if self.sample_time else ()),
        ):
            if any(not value > 0 for value in values):
                raise ArgumentError(f"{name} is not positive", got=values, expected="numbers greater than 0")
        if not 0 <= self.delay <= (self.sample_time or 0.0):
            raise ArgumentError(
                "delay is out of range", got=self.delay, expected=f"0 to the sample time, {self.sample_time or 0.0} s"
            )

    def saturated(self, torque: Array) -> Array:
        """The torque that the motor gives."""
        return torque if self.limit is None else np.clip(torque, -np.array(self.limit), self.limit)


def scene_drive(lin: Linearization) -> Drive:
    """The drive that the scene's control tables describe."""
    if lin.control is None:
        return Drive()
    limit, sampling = lin.control.saturation, lin.control.sampling
    return Drive(
        None if limit is None else limit.torque,
        None if sampling is None else sampling.period,
        0.0 if sampling is None else sampling.delay,
    )


def torque_law(
    lin: Linearization, feedback: MatrixFunction | None = None, feedforward: Feedforward | None = None
) -> TorqueLaw:
    """The scene's own law, with a given feedback or feedforward in the place of its own."""
    own, m, n = own_gain(lin), len(lin.driven), lin.n
    gain = feedback or (lambda t: np.broadcast_to(own, (len(t), *own.shape)))
    if feedforward is not None:
        return TorqueLaw(feedforward.torque, gain, feedforward.reference)
    rest = lambda t: np.zeros((len(t), 2 * n))  # noqa: E731
    if default_closing(lin) is rigid_feedforward:
        return TorqueLaw(lin.feedforward, gain, rest)
    return TorqueLaw(lambda t: np.zeros((len(t), m)), gain, rest)
