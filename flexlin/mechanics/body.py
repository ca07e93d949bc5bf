"""A frame that moves in space, carried along the chain, and a deformable mass seen from it by six moments, with its kinetic energy."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from flexlin.checks import SUM_ROUNDING
from flexlin.lazy import lazy
from flexlin.scene.links import Inertia


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


NOTHING = ca.SX()
"""Makes numbers that are put beside it expressions."""
X, Y, Z = ca.horzsplit(ca.SX.eye(3))


def cross_matrix(a: ca.SX) -> ca.SX:
    """The matrix (3, 3) with cross_matrix(a) b = a x b."""
    return ca.sparsify(ca.skew(a))


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
    if angle.is_constant():  # pi/2 is no floating-point number
        c, s = (ca.SX(0 if abs(float(part)) < SUM_ROUNDING else float(part)) for part in (c, s))
    if axis.nnz() == 1 and axis.is_constant():  # of length 1, so along a coordinate
        (k,), s = axis.sparsity().row(), s if float(axis.nz[0]) > 0 else -s
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = ca.SX.triplet([k, i, j, j, i], [k, i, j, i, j], ca.vertcat(1, c, c, s, -s), 3, 3)
        return ca.sparsify(turn) if angle.is_constant() else turn
    along = axis @ axis.T
    return ca.sparsify(along + c * ca.sparsify(ca.SX.eye(3) - along) + s * cross_matrix(axis))


@dataclass(frozen=True)
class Moments:
    """The moments of a mass whose points lie at r(t) in a moving frame.

        mass = int dm,                        first = int r dm,          first_rate = int r' dm,
        second = int (r.r E - r r^T) dm,      swirl = int r x r' dm,     agitation = int r'.r' dm

    Units: kg, kg m, kg m/s, kg m^2, kg m^2/s, kg m^2/s^2; first, first_rate and swirl are (3, 1), second is (3, 3). What is zero
    has no entry.
    """

    mass: ca.SX = field(default_factory=lambda: ca.SX(0))
    first: ca.SX = field(default_factory=lambda: ca.SX(3, 1))
    first_rate: ca.SX = field(default_factory=lambda: ca.SX(3, 1))
    second: ca.SX = field(default_factory=lambda: ca.SX(3, 3))
    swirl: ca.SX = field(default_factory=lambda: ca.SX(3, 1))
    agitation: ca.SX = field(default_factory=lambda: ca.SX(0))

    def __add__(self, other: "Moments") -> "Moments":
        return Moments(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


@dataclass(frozen=True)
class Body:
    """A mass carried by a frame."""

    frame: Frame
    moments: Moments

    def kinetic_energy(self) -> ca.SX:
        """Kinetic energy of the mass.

            T = m/2 v.v + v.(w x first + first_rate) + 1/2 w.second w + w.swirl + 1/2 agitation

        with v the frame's velocity and w its angular velocity, both in its own axes. Returns: J.
        """
        v, w, k = self.frame.velocity, self.frame.spin, self.moments
        squares = k.mass * ca.sumsqr(v) + ca.dot(ca.diag(k.second), w**2) + k.agitation
        drift, turning = ca.cross(w, k.first) + k.first_rate, ca.triu(k.second, False) @ w + k.swirl
        return squares / 2 + ca.dot(v, drift) + ca.dot(w, turning)

    def mass_moment(self) -> ca.SX:
        """int (position) dm in world axes, (3, 1), in kg m: the gradient of the potential energy in a uniform field."""
        return self.moments.mass * self.frame.position + self.frame.rotation @ self.moments.first

    @property
    def is_rigid(self) -> bool:
        """Whether it has a mass and nothing of it moves in the frame."""
        k = self.moments
        still = not any(ca.SX(part).nnz() for part in (k.first_rate, k.swirl)) and ca.SX(k.agitation).is_zero()
        return still and not ca.SX(k.mass).is_zero()

    def split(self) -> "tuple[InertiaForm, Body]":
        """A rigid body as its mass at its centre, and its inertia about it."""
        k = self.moments
        lever = cross_matrix(k.first / k.mass)
        about = ca.sparsify(k.second - k.mass * (lever.T @ lever))
        centre = self.frame.position + self.frame.rotation @ (k.first / k.mass)
        return InertiaForm(ca.sparsify(centre), ca.SX(k.mass)), Body(self.frame, Moments(second=about))


@dataclass(frozen=True, eq=False)
class InertiaForm:
    """A mass whose points are combinations of a few vectors r_j in world axes: int r'.r' dm = sum_jk form_jk r_j'.r_k'.

    vectors (3, k), the first a place in m that moves as a whole; form (k, k), symmetric and positive definite, in kg and m.
    """

    vectors: ca.SX
    form: ca.SX

    def mass_moment(self) -> ca.SX:
        """int (position) dm in world axes, (3, 1), in kg m."""
        return ca.sparsify(self.vectors @ self.form[:, 0])


@dataclass(frozen=True)
class RigidMass:
    """A rigid body where a link can carry one: mass (kg), inertia about z, or the joint's axis (kg m^2), centre at `offset` along x (m).

    In space its centre lies by `centre` further, and it has the inertia `tensor` about its centre too.
    """

    mass: Any
    inertia: Any
    offset: Any = 0.0
    centre: tuple[Any, Any, Any] = (0.0, 0.0, 0.0)
    tensor: Inertia = field(default_factory=Inertia)

    @property
    def is_nothing(self) -> bool:
        """Whether it has neither mass nor inertia, and no symbol in the place of either."""
        figures = (self.mass, self.inertia, *self.tensor.entries().values())
        return all(isinstance(figure, int | float) and figure == 0 for figure in figures)

    @property
    def place(self) -> tuple[Any, Any, Any]:
        """Its centre on a tip (m)."""
        x, y, z = self.centre
        return self.offset + x, y, z

    def carried_by(self, frame: Frame, axis: ca.SX) -> Body:
        """The body in a frame, with its inertia about an axis of length 1."""
        inertia = tensor(**self.tensor.entries()) + about(axis, self.inertia)
        return Body(frame, rigid_moments(self.mass, inertia, column(*self.place)))


def rigid_moments(mass: Any, inertia: ca.SX, centre: ca.SX) -> Moments:
    """The moments of a rigid body with its centre at `centre` (3, 1) and `inertia` (3, 3) about its centre."""
    mass = ca.SX(mass)
    if not centre.nnz():
        return Moments(mass=mass, second=inertia)
    lever = cross_matrix(centre)
    return Moments(mass=mass, first=mass * centre, second=inertia + mass * (lever.T @ lever))


def tensor(xx: Any = 0, yy: Any = 0, zz: Any = 0, xy: Any = 0, xz: Any = 0, yz: Any = 0) -> ca.SX:
    """A symmetric matrix (3, 3) that holds only what is not zero."""
    return ca.sparsify(ca.reshape(ca.vertcat(NOTHING, xx, xy, xz, xy, yy, yz, xz, yz, zz), 3, 3))


def about(axis: ca.SX, inertia: Any) -> ca.SX:
    """The inertia (3, 3) of a body that has one about an axis and none across it."""
    return ca.sparsify(inertia * (axis @ axis.T))
