"""Motor and gear: a voltage u drives i = (u - k N q') / R, and the joint feels N k i and the rotor N^2 J_m.

    T = 1/2 N^2 J_m theta'^2,   torque = N k / R u - N^2 k^2 / R theta'

with theta the motor's angle on the link side (the joint's, unless the joint is flexible). The input of the manipulator is then the
voltage. Assumes the winding's inductance too fast to matter. Source: Spong, Hutchinson, Vidyasagar (2006), section 6.1.
"""

from typing import Annotated, Any

import casadi as ca

from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale, per_joint, per_motor
from flexlin.precision import MINOR
from flexlin.scene.base import AllPositive, PerLink, Unit


class Motor(Effect):
    """A direct-current motor behind a gear, whose input is its voltage; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    input_unit = "V"
    torque_constant: Annotated[AllPositive, Unit("N m/A")]
    """Torque of the motor per current."""
    resistance: Annotated[AllPositive, Unit("ohm")]
    """Resistance of the winding."""
    gear_ratio: Annotated[AllPositive, Unit("")] = 1.0
    """Turns of the motor per turn of the joint."""
    rotor_inertia: Annotated[PerLink, Unit("kg m^2")] = 0.0
    """Inertia of the rotor about its own axis."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "Motor":
        """k = R, so that a volt is a newton metre and the back electromotive force a small damper."""
        constants = scale.of_inertias(2 * LOSS * scale.motion)
        return cls(torque_constant=constants, resistance=constants, rotor_inertia=scale.of_inertias(MINOR))

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        inertias = per_motor(self.gear_ratio, chain) ** 2 * per_motor(self.rotor_inertia, chain)
        return ca.dot(inertias, chain.motor_rate**2) / 2

    def dissipation(self, chain: Chain) -> ca.SX:
        """R = 1/2 N^2 k^2 / R theta'^2, the work of the back electromotive force."""
        driven = [i for i in chain.moving if not chain.links[i].table.passive]
        damping = [self.input_gain(i) ** 2 * self._of("resistance", i) if i in driven else 0.0 for i in chain.moving]
        return ca.dot(ca.vertcat(*damping), chain.motor_rate**2) / 2

    def input_gain(self, joint: int) -> Any:
        return self._of("gear_ratio", joint) * self._of("torque_constant", joint) / self._of("resistance", joint)

    def _of(self, name: str, joint: int) -> Any:
        return per_joint(getattr(self, name), joint)
