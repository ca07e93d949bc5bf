"""What commands the torque, answered once: torque = forward(t) - gain(t) ([y; y'] - reference(t))."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Constant, MatrixFunction
from flexlin.summary import represent

VectorFunction = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Law:
    """A control law: torque = forward(t) - gain(t) ([y; y'] - reference(t)), in N m (N for sliding joints, V for motors).

    feedforward: its kind, "none", "rigid" (the torque of the rigid motion), or that of a computed one such as "tip-exact";
    forward, gain, reference: times (N,) -> (N, m), (N, m, 2n), (N, 2n).
    """

    feedforward: str
    forward: VectorFunction
    gain: MatrixFunction
    reference: VectorFunction

    __repr__ = represent

    @classmethod
    def constant(cls, gain: ArrayLike, forward: ArrayLike | None = None) -> "Law":
        """A constant gain (m, 2n), and if given a constant torque (m,)."""
        K = real_array("gain", gain, (None, None))
        torque = np.zeros(len(K)) if forward is None else real_array("forward", forward, (len(K),))
        kind = "none" if forward is None else "constant"
        return cls(kind, Constant(torque), Constant(K), Constant(np.zeros(K.shape[1])))

    def with_gain(self, gain: MatrixFunction | ArrayLike) -> "Law":
        """The same feedforward and reference with another gain: a function (N,) -> (N, m, 2n), or a constant (m, 2n).

        Raises: ArgumentError when its shape is not that of this law's gain.
        """
        chosen = gain if callable(gain) else Constant(real_array("gain", gain, (None, None)))
        now = np.zeros(1)
        got, expected = np.shape(chosen(now))[1:], np.shape(self.gain(now))[1:]
        if got != expected:
            raise ArgumentError("the gain does not fit the arm", got=got, expected=str(expected))
        return replace(self, gain=chosen)

    def offset(self, t: Array) -> Array:
        """What the law commands at x = 0: forward + gain reference, (N, m)."""
        return self.forward(t) + np.einsum("tij,tj->ti", self.gain(t), self.reference(t))

    def torque(self, t: Array, x: Array) -> Array:
        """The commanded torque (N, m) for states x = [y; y'] (N, 2n)."""
        return self.forward(t) - np.einsum("tij,tj->ti", self.gain(t), x - self.reference(t))


def is_constant(samples: Array) -> bool:
    """Whether samples (N, ...) are one value that was broadcast."""
    return samples.strides[0] == 0
