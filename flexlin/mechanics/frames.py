"""A frame that moves in the plane, carried along the chain from joint to joint."""

from dataclasses import dataclass

import casadi as ca

QUARTER_TURN = ca.DM([[0, -1], [1, 0]])
"""J of the plane: J v is v turned by +90 degrees, so a point at rest in a frame of rate w moves with w J r."""


@dataclass(frozen=True)
class Frame:
    """Orientation and position of a moving frame, with their rates; vectors are (2, 1).

    The position is in world axes (m), the velocity in the frame's own axes (m/s): kinetic energy then holds relative angles only.
    """

    angle: ca.SX
    rate: ca.SX
    position: ca.SX
    velocity: ca.SX

    @classmethod
    def fixed(cls) -> "Frame":
        """The base, at rest."""
        return cls(ca.SX(0), ca.SX(0), ca.SX.zeros(2), ca.SX.zeros(2))

    @property
    def rotation(self) -> ca.SX:
        """R(angle), from this frame's axes to the world's."""
        return rotation(self.angle)

    def turned(self, angle: ca.SX, rate: ca.SX) -> "Frame":
        """The frame behind a joint at the origin."""
        return Frame(self.angle + angle, self.rate + rate, self.position, rotation(angle).T @ self.velocity)

    def moved(self, offset: ca.SX, offset_rate: ca.SX) -> "Frame":
        """The frame whose origin lies at `offset`, which changes with `offset_rate`, both in this frame's axes."""
        velocity = self.velocity + offset_rate + self.rate * (QUARTER_TURN @ offset)
        return Frame(self.angle, self.rate, self.position + self.rotation @ offset, velocity)


def rotation(angle: ca.SX) -> ca.SX:
    """The rotation matrix of the plane, (2, 2)."""
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(ca.horzcat(c, -s), ca.horzcat(s, c))
