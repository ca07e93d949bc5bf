"""Coulomb joint friction: a torque -c tanh(q' / eps) on each joint; eps is the rate below which it counts as sticking.

The linearization takes its slope c / eps (1 - tanh^2(q' / eps)) into D_L: near rest that is a stiff damper, in fast motion nothing. It says
what a small disturbance feels while the joint slides; where the basic motion turns round the slope changes within |q'| of a few eps, and
a disturbance larger than eps in rate feels less than the slope. Source: Armstrong-Helouvry, Dupont, Canudas de Wit (1994), section 2.
"""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect, per_joint


class CoulombFriction(Effect):
    """Sliding torque c in N m and rate eps in rad/s, one a joint or one for every joint."""

    def joint_resistance(self, chain: Chain) -> ca.SX:
        joints = range(len(chain.joints))
        torque, rate = (
            ca.vertcat(*[per_joint(v, i, single="every") for i in joints]) for v in (self.table.torque, self.table.rate)
        )
        return torque * ca.tanh(chain.q_rate / rate)
