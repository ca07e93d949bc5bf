"""Spin of geared rotors: a rotor on the link before its joint turns by N theta' about the joint's axis, and with that link.

    T = 1/2 J (a.w + N theta')^2 - 1/2 J (a.w)^2 - 1/2 J N^2 theta'^2 = N J (a.w) theta'

with a the joint's axis and w the angular velocity of the link before it. The squares belong to others: the first to that link's
inertia, the second to `motor_inertia` or `rotor_inertia`. Assumes rotors round about their axes. Source: Murphy, Wen, Saridis,
Simulation of cooperating robot manipulators on a mobile platform (1991); Spong (1987) leaves this term out.
"""

from typing import Annotated

import casadi as ca

from flexlin.mechanics.body import Z
from flexlin.mechanics.effects.base import Chain, Effect, Scale, per_joint
from flexlin.precision import MINOR
from flexlin.scene.base import Number, PerLink, Unit


class RotorSpin(Effect):
    """The spin of the motors' rotors, which turn with the link before their joint too; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    inertia: Annotated[PerLink, Unit("kg m^2")]
    """Inertia of the rotor about its own axis."""
    gear_ratio: Annotated[Number | tuple[Number, ...], Unit("")]
    """Turns of the motor per turn of the joint; negative where it turns the other way."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "RotorSpin":
        """Rotors as heavy, seen through gears of 100, as those that other effects are tried with."""
        return cls(inertia=scale.of_inertias(MINOR / 100.0**2), gear_ratio=100.0)

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        """T = sum N J (a.w) theta' over the joints that turn."""
        energy = ca.SX(0)
        for place, i in enumerate(chain.moving):
            link = chain.links[i].table
            if link.joint == "revolute" and not link.passive:
                momentum = per_joint(self.gear_ratio, i) * per_joint(self.inertia, i)
                before = chain.mounts[i].turned(Z, link.mount_angle)
                energy += momentum * ca.dot(chain.axes[i], before.spin) * chain.motor_rate[place]
        return energy
