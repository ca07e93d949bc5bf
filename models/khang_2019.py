"""The single-link flexible manipulator of Khang, Dat and Tuan (2019), typed in by hand as CasADi matrices.

Nothing here comes from flexlin's own chain: it is the second, independent way to the same equations.
"""

from typing import Annotated

import casadi as ca

import flexlin as fl
from flexlin.scene import register_model
from flexlin.scene.base import NonNegative, Number, Positive, Table, Unit

BETA = 1.8751040687119612
SIGMA = 0.7340955137589128
FIRST_MODE = {"X(l)": 2.0, "int X": 2 * SIGMA / BETA, "int xi X": 2 / BETA**2, "int X^2": 1.0, "int X''^2": BETA**4}
"""First clamped-free mode X = cosh - cos - sigma (sinh - sin) of unit length, in closed form. Source: Felgar (1950), Formulas for
Integrals Containing Characteristic Functions of a Vibrating Beam, University of Texas Circular 14."""


class Parameters(Table):
    """The constants of the paper, SI units."""

    length: Annotated[Positive, Unit("m")]
    """Length of the link."""
    mass_per_length: Annotated[Positive, Unit("kg/m")]
    """Mass per length."""
    bending_stiffness: Annotated[Positive, Unit("N m^2")]
    """Bending stiffness E I."""
    hub_inertia: Annotated[NonNegative, Unit("kg m^2")]
    """Inertia of the hub about the joint."""
    payload_mass: Annotated[NonNegative, Unit("kg")]
    """Mass at the tip."""
    gravity: Annotated[Number, Unit("m/s^2")] = 9.81
    """Acceleration of gravity."""


def build(p: Parameters) -> fl.Manipulator:
    """M, C, g of the paper's Eq. (55) with s = [q_a; w].

        Bw  = rhoA m11 + m_E X(l)^2
        M   = [[J1 + m_E l^2 + m_OE l^2/3 + Bw w^2, rhoA D1 + m_E l X(l)], [., Bw]]
        C   = [[Bw w w', Bw w q'], [-Bw w q', 0]]
        g1  = (m_E l + m_OE l/2) g cos q - (rhoA C1 + m_E X(l)) g w sin q
        g2  = (rhoA C1 + m_E X(l)) g cos q + EI k11 w

    Assumes one mode and no geometric stiffening.
    Source: Khang, Dat, Tuan (2019), Eqs (54)-(55) and (68)-(71); constants C1 = int X, D1 = int x X, m11 = int X^2, k11 = int X''^2.
    """
    s, s_dot = ca.SX.sym("s", 2), ca.SX.sym("s_dot", 2)
    q, w, q_dot, w_dot = s[0], s[1], s_dot[0], s_dot[1]
    L, rhoA, m_E, J1, g = p.length, p.mass_per_length, p.payload_mass, p.hub_inertia, p.gravity
    X_l, m_OE = FIRST_MODE["X(l)"], rhoA * L
    C1, D1 = FIRST_MODE["int X"] * L, FIRST_MODE["int xi X"] * L**2
    m11, k11 = FIRST_MODE["int X^2"] * L, FIRST_MODE["int X''^2"] / L**3
    Bw, coupling, pull = rhoA * m11 + m_E * X_l**2, rhoA * D1 + m_E * L * X_l, (rhoA * C1 + m_E * X_l) * g
    M11 = J1 + m_E * L**2 + m_OE * L**2 / 3 + Bw * w**2
    M = ca.vertcat(ca.horzcat(M11, coupling), ca.horzcat(coupling, Bw))
    C = ca.vertcat(ca.horzcat(Bw * w * w_dot, Bw * w * q_dot), ca.horzcat(-Bw * w * q_dot, 0))
    weight = ca.vertcat(
        (m_E * L + m_OE * L / 2) * g * ca.cos(q) - pull * w * ca.sin(q),
        pull * ca.cos(q) + p.bending_stiffness * k11 * w,
    )
    tip = ca.vertcat(L * ca.cos(q) - X_l * w * ca.sin(q), L * ca.sin(q) + X_l * w * ca.cos(q))
    points = ca.horzcat(ca.SX.zeros(2), tip)
    return fl.Manipulator.from_matrices(s, s_dot, M, C, weight, B=ca.DM([1, 0]), names=("q1", "w11"), points=points)


register_model("khang-2019", Parameters, build)
