"""A frame that moves in space, carried along the chain from joint to joint.

Every vector and matrix keeps structural zeros: an arm whose axes are parallel has the expressions of a plane, and no others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from flexlin.lazy import lazy

ROUNDING = 1e-15
"""Cosines and sines of fixed angles that are smaller are zero: pi/2 is no floating-point number."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Orientation and position of a moving frame, with their rates; vectors are (3, 1).

    The position is in world axes (m); the velocity (m/s) and the angular velocity `spin` (rad/s) are in the frame's own axes: kinetic
    energy then holds relative angles only. The rotation is `before` times a turn by `angle` about `axis`, so that turns about one
    axis add their angles instead of multiplying matrices.
    """

    before: ca.SX
    axis: ca.SX
    angle: ca.SX
    spin: ca.SX
    position: ca.SX
    velocity: ca.SX

    @classmethod
    def fixed(cls) -> "Frame":
        """The base, at rest."""
        return cls(ca.SX.eye(3), Z, ca.SX(0), ca.SX(3, 1), ca.SX(3, 1), ca.SX(3, 1))

    @lazy
    def rotation(self) -> ca.SX:
        """R (3, 3), from this frame's axes to the world's."""
        return self.before @ rotation_about(self.axis, self.angle)

    def turned(self, axis: ca.SX, angle: Any, rate: Any = 0) -> "Frame":
        """The frame behind a turn about an axis through the origin; a turn leaves its own axis where it is."""
        angle, rate = (part if isinstance(part, ca.SX) else ca.SX(part) for part in (angle, rate))
        if angle.is_zero() and rate.is_zero():
            return self
        back = rotation_about(axis, angle).T
        before, whole = (self.before, self.angle + angle) if is_same(axis, self.axis) else (self.rotation, angle)
        spin = back @ self.spin + axis * ca.sparsify(rate)
        return Frame(before, axis, whole, spin, self.position, back @ self.velocity)

    def turned_by(self, angles: Sequence[Any], rates: Sequence[Any] = (0, 0, 0)) -> "Frame":
        """The frame behind turns about z, y and x, one after the other."""
        frame = self
        for axis, angle, rate in zip((Z, Y, X), angles, rates, strict=True):
            frame = frame.turned(axis, angle, rate)
        return frame

    def facing(self, yaw: ca.SX, pitch: ca.SX) -> ca.SX:
        """The direction of the x axis behind turns about z and then y, (3, 1), in world axes."""
        if not pitch.nnz() and is_same(self.axis, Z):
            return self.before @ rotation_about(Z, self.angle + yaw)[:, 0]
        return self.rotation @ ca.sparsify(
            (rotation_about(Z, yaw) if yaw.nnz() else ca.SX.eye(3)) @ rotation_about(Y, pitch)[:, 0]
        )

    def moved(self, offset: ca.SX, offset_rate: ca.SX) -> "Frame":
        """The frame whose origin lies at `offset`, which changes with `offset_rate`, both in this frame's axes."""
        if not offset.nnz() and not offset_rate.nnz():
            return self
        velocity = self.velocity + offset_rate + ca.cross(self.spin, offset)
        return Frame(self.before, self.axis, self.angle, self.spin, self.position + self.rotation @ offset, velocity)


def column(*entries: Any) -> ca.SX:
    """A column that holds only what is not zero."""
    return ca.sparsify(ca.vertcat(NOTHING, *entries))


NOTHING = ca.SX(0, 1)
"""Makes numbers that are put beside it expressions."""
X, Y, Z = column(1, 0, 0), column(0, 1, 0), column(0, 0, 1)


def cross_matrix(a: ca.SX) -> ca.SX:
    """The matrix (3, 3) with cross_matrix(a) b = a x b."""
    x, y, z, none = a[0], a[1], a[2], ca.SX(1, 1)
    rows = ((none, -z, y), (z, none, -x), (-y, x, none))
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def is_same(a: ca.SX, b: ca.SX) -> bool:
    """Whether two expressions are equal as they stand."""
    return a is b or bool((a - b).is_zero())


def unit(direction: Any) -> ca.SX:
    """A direction of three numbers or symbols as a column of length 1."""
    length = sum(entry**2 for entry in direction) ** 0.5
    return column(*[entry / length for entry in direction])


def directions_across(axis: ca.SX) -> ca.SX:
    """Two directions of length 1 across an axis of length 1 and each other, (3, 2); of coordinate axes they are coordinate axes too.

    Source: Duff et al., Building an orthonormal basis, revisited, J. Computer Graphics Techniques 6 (2017) 1.
    """
    x, y, z = (axis[i] for i in range(3))
    sign = ca.if_else(z < 0, -1, 1)
    a = -1 / (sign + z)
    b = x * y * a
    first, second = (1 + sign * x**2 * a, sign * b, -sign * x), (b, sign + y**2 * a, -y)
    return ca.sparsify(ca.simplify(ca.horzcat(*[ca.vertcat(*column) for column in (first, second)])))


def rotation_about(axis: ca.SX, angle: ca.SX) -> ca.SX:
    """Rodrigues' rotation matrix, (3, 3).

    R = a a^T + cos(angle) (E - a a^T) + sin(angle) a~
    """
    c, s = ca.cos(angle), ca.sin(angle)
    if angle.is_constant():
        c, s = (ca.SX(0 if abs(float(part)) < ROUNDING else float(part)) for part in (c, s))
    if axis.nnz() == 1 and axis.is_constant():  # of length 1, so along a coordinate
        (k,), s = axis.sparsity().row(), s if float(axis.nz[0]) > 0 else -s
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = ca.SX.triplet([k, i, j, j, i], [k, i, j, i, j], ca.vertcat(1, c, c, s, -s), 3, 3)
        return ca.sparsify(turn) if angle.is_constant() else turn
    along = axis @ axis.T
    return ca.sparsify(along + c * ca.sparsify(ca.SX.eye(3) - along) + s * cross_matrix(axis))
