"""Motor and gear: a voltage u drives i = (u - k N q') / R, and the joint feels N k i and the rotor N^2 J_m.

    T = 1/2 N^2 J_m theta'^2,   torque = N k / R u - N^2 k^2 / R theta'

with theta the motor's angle on the link side (the joint's, unless the joint is flexible). The input of the manipulator is then the
voltage. Assumes the winding's inductance too fast to matter. Source: Spong, Hutchinson, Vidyasagar (2006), section 6.1.
"""

from typing import Any

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect, per_joint


class Motor(Effect):
    """Torque constant k in N m/A (V s/rad), resistance R in ohm, gear ratio N, rotor inertia J_m in kg m^2."""

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        inertias = [self._of("gear_ratio", i) ** 2 * self._of("rotor_inertia", i) for i in range(len(chain.joints))]
        return ca.dot(ca.vertcat(*inertias), chain.motor_rate**2) / 2

    def dissipation(self, chain: Chain) -> ca.SX:
        """R = 1/2 N^2 k^2 / R theta'^2, the work of the back electromotive force."""
        damping = [self.input_gain(i) ** 2 * self._of("resistance", i) for i in range(len(chain.joints))]
        return ca.dot(ca.vertcat(*damping), chain.motor_rate**2) / 2

    def input_gain(self, joint: int) -> Any:
        return self._of("gear_ratio", joint) * self._of("torque_constant", joint) / self._of("resistance", joint)

    def _of(self, name: str, joint: int) -> Any:
        return per_joint(getattr(self.table, name), joint, single="every")
