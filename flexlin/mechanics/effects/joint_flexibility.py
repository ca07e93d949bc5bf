"""Joint flexibility: each motor has a coordinate theta of its own behind a spring, V = 1/2 k (theta - q)^2, T = 1/2 J_m theta'^2.

Assumes the motor's inertia, reflected to the link side, sees its own rate only (gears turn it much faster than the links).
Source: Spong (1987), Modeling and control of elastic joint robots.
"""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect, per_joint


class JointFlexibility(Effect):
    """Stiffness in N m/rad and motor inertia in kg m^2 on the link side, one a joint or one for every joint."""

    def frees_motors(self) -> bool:
        return True

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        inertias = [per_joint(self.table.motor_inertia, i, single="every") for i in range(len(chain.joints))]
        return ca.dot(ca.vertcat(*inertias), chain.motor_rate**2) / 2

    def potential_energy(self, chain: Chain) -> ca.SX:
        stiffness = [per_joint(self.table.stiffness, i, single="every") for i in range(len(chain.joints))]
        return ca.dot(ca.vertcat(*stiffness), (chain.motor - chain.q) ** 2) / 2
