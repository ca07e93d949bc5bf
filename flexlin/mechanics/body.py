"""A deformable mass seen from a moving frame: six moments say all that the energies need."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from flexlin.mechanics.frames import NOTHING, Frame, cross_matrix
from flexlin.scene.links import Inertia


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
        return Moments(
            self.mass + other.mass,
            self.first + other.first,
            self.first_rate + other.first_rate,
            self.second + other.second,
            self.swirl + other.swirl,
            self.agitation + other.agitation,
        )


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
    tensor: Inertia | None = None

    @property
    def is_nothing(self) -> bool:
        """Whether it has neither mass nor inertia, and no symbol in the place of either."""
        figures = (self.mass, self.inertia, *(self.tensor.entries().values() if self.tensor else ()))
        return all(isinstance(figure, int | float) and figure == 0 for figure in figures)


def rigid_body(frame: Frame, mass: Any, inertia: ca.SX, centre: ca.SX | None = None) -> Body:
    """A rigid body with its centre at `centre` (3, 1) in the frame's axes and `inertia` (3, 3) about its centre."""
    return Body(frame, rigid_moments(mass, inertia, ca.SX(3, 1) if centre is None else centre))


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
