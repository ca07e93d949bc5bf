"""Viscous joint friction: a torque -c q' on each joint, R = 1/2 sum c q'^2."""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect, per_joint


class ViscousFriction(Effect):
    """One coefficient a joint, or one for every joint, in N m s/rad."""

    def dissipation(self, chain: Chain) -> ca.SX:
        coefficients = [per_joint(self.table.coefficient, i, single="every") for i in range(chain.q.numel())]
        return ca.dot(ca.vertcat(*coefficients), chain.q_rate**2) / 2
