"""A deformable mass seen from a moving frame: six moments say all that the energies need."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from flexlin.mechanics.frames import QUARTER_TURN, Frame


@dataclass(frozen=True)
class Moments:
    """The moments of a mass whose points lie at r(t) in a moving frame.

        mass = int dm,            first = int r dm,          first_rate = int r' dm,
        second = int r.r dm,      swirl = int r x r' dm,     agitation = int r'.r' dm

    Units: kg, kg m, kg m/s, kg m^2, kg m^2/s, kg m^2/s^2; the firsts are (2, 1).
    """

    mass: ca.SX = field(default_factory=lambda: ca.SX(0))
    first: ca.SX = field(default_factory=lambda: ca.SX.zeros(2))
    first_rate: ca.SX = field(default_factory=lambda: ca.SX.zeros(2))
    second: ca.SX = field(default_factory=lambda: ca.SX(0))
    swirl: ca.SX = field(default_factory=lambda: ca.SX(0))
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

            T = m/2 v.v + v.(w J first + first_rate) + w^2/2 second + w swirl + 1/2 agitation

        with v the frame's velocity in its own axes and w its rate. Returns: J.
        """
        v, w, k = self.frame.velocity, self.frame.rate, self.moments
        drift = w * (QUARTER_TURN @ k.first) + k.first_rate
        return k.mass / 2 * ca.sumsqr(v) + ca.dot(v, drift) + w**2 / 2 * k.second + w * k.swirl + k.agitation / 2

    def mass_moment(self) -> ca.SX:
        """int (position) dm in world axes, (2, 1), in kg m: the gradient of the potential energy in a uniform field."""
        return self.moments.mass * self.frame.position + self.frame.rotation @ self.moments.first


@dataclass(frozen=True)
class RigidMass:
    """A rigid body where a link can carry one: mass (kg), inertia about its centre (kg m^2), centre at `offset` along the frame (m)."""

    mass: Any
    inertia: Any
    offset: Any = 0.0


def rigid_body(frame: Frame, mass: ca.SX, inertia: ca.SX, offset: ca.SX | None = None) -> Body:
    """A rigid body with its centre at `offset` (2, 1) in the frame's axes and `inertia` about its centre."""
    if offset is None:
        return Body(frame, Moments(mass=mass, second=inertia))
    return Body(frame, Moments(mass=mass, first=mass * offset, second=inertia + mass * ca.sumsqr(offset)))
