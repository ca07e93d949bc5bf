"""The single-link flexible manipulator of Khang, Dat and Tuan (2019), typed in by hand as CasADi matrices, with any number of modes.

Nothing here comes from flexlin's own chain: it is the second, independent way to the same equations.
"""

from typing import Annotated

import casadi as ca
import numpy as np
from pydantic import Field

import flexlin as fl
from flexlin.scene import register_model
from flexlin.scene.base import NonNegative, Number, Positive, Table, Unit

NEWTON_STEPS = 8


class UniformLink(Table):
    """The paper's link, a uniform beam clamped to the hub."""

    length: Annotated[Positive, Unit("m")]
    """Length of the link."""
    mass_per_length: Annotated[Positive, Unit("kg/m")]
    """Mass per length."""
    bending_stiffness: Annotated[Positive, Unit("N m^2")]
    """Bending stiffness E I."""
    modes: Annotated[int, Field(strict=True, ge=0, le=60)] = 1
    """Number of clamped-free modes; the paper has one."""


class Parameters(Table):
    """The constants of the paper, SI units."""

    links: Annotated[tuple[UniformLink, ...], Field(min_length=1, max_length=1)]
    """The link, the only one."""
    hub_inertia: Annotated[NonNegative, Unit("kg m^2")]
    """Inertia of the hub about the joint."""
    payload_mass: Annotated[NonNegative, Unit("kg")]
    """Mass at the tip."""
    gravity: Annotated[Number, Unit("m/s^2")] = 9.81
    """Acceleration of gravity."""


def build(p: Parameters) -> fl.Manipulator:
    """M, C, g of the paper's Eq. (55) with s = [q_a; w], w the deflections of N modes at once.

        Bw  = rhoA m + m_E X(l) X(l)^T
        M   = [[J1 + m_E l^2 + m_OE l^2/3 + w^T Bw w, (rhoA D1 + m_E l X(l))^T], [., Bw]]
        C   = [[w^T Bw w', (Bw w)^T q'], [-Bw w q', 0]]
        g1  = (m_E l + m_OE l/2) g cos q - (rhoA C1 + m_E X(l))^T w g sin q
        g2  = (rhoA C1 + m_E X(l)) g cos q + EI k w

    Assumes no geometric stiffening. The paper has N = 1; with more its products of w become these sums over the modes.
    Source: Khang, Dat, Tuan (2019), Eqs (54)-(55) and (68)-(71); constants C1 = int X, D1 = int x X, m = int X X^T, k = int X'' X''^T.
    """
    link, m_E, J1, g = p.links[0], p.payload_mass, p.hub_inertia, p.gravity
    L, rhoA, N = link.length, link.mass_per_length, link.modes
    s, s_dot = ca.SX.sym("s", 1 + N), ca.SX.sym("s_dot", 1 + N)
    q, w, q_dot, w_dot = s[0], s[1:, 0], s_dot[0], s_dot[1:, 0]
    beta, sigma, X_l = clamped_free_modes(N)
    m_OE, C1, D1 = rhoA * L, 2 * sigma / beta * L, 2 / beta**2 * L**2
    m, k = ca.DM.eye(N) * L, ca.diag(beta**4) / L**3
    Bw, coupling, pull = rhoA * m + m_E * X_l @ X_l.T, rhoA * D1 + m_E * L * X_l, (rhoA * C1 + m_E * X_l) * g
    M11 = J1 + m_E * L**2 + m_OE * L**2 / 3 + w.T @ Bw @ w
    M = ca.blockcat([[M11, coupling.T], [coupling, Bw]])
    C = ca.blockcat([[w.T @ Bw @ w_dot, (Bw @ w).T * q_dot], [-Bw @ w * q_dot, ca.SX.zeros(N, N)]])
    weight = ca.vertcat(
        (m_E * L + m_OE * L / 2) * g * ca.cos(q) - pull.T @ w * ca.sin(q),
        pull * ca.cos(q) + link.bending_stiffness * k @ w,
    )
    bent = X_l.T @ w
    tip = ca.vertcat(L * ca.cos(q) - bent * ca.sin(q), L * ca.sin(q) + bent * ca.cos(q))
    names = ("q1", *(f"w1{'' if N < 10 else '_'}{i + 1}" for i in range(N)))
    B = ca.vertcat(ca.DM(1), ca.DM.zeros(N))
    return fl.Manipulator.from_matrices(
        s, s_dot, M, C, weight, B=B, names=names, points=ca.horzcat(ca.SX.zeros(2), tip)
    )


def clamped_free_modes(count: int) -> tuple[ca.DM, ca.DM, ca.DM]:
    """beta, sigma, X(1), each (count, 1), of the first modes X = cosh - cos - sigma (sinh - sin) of beta x, of unit length.

        cos beta cosh beta = -1,   sigma = (cosh + cos)/(sinh + sin),   X_i(1) = 2 (-1)^(i+1)
        int X = 2 sigma/beta,   int x X = 2/beta^2,   int X_i X_j = delta_ij,   int X_i'' X_j'' = beta_i^4 delta_ij

    Source: Felgar (1950), Formulas for Integrals Containing Characteristic Functions of a Vibrating Beam, University of Texas Circular 14.
    """
    i = np.arange(count)
    beta = (i + 0.5) * np.pi
    for _ in range(NEWTON_STEPS):
        beta += (np.cos(beta) + 1 / np.cosh(beta)) / (np.sin(beta) + np.tanh(beta) / np.cosh(beta))
    sigma = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    return ca.DM(beta), ca.DM(sigma), ca.DM(2.0 * (-1.0) ** i)


register_model("khang-2019", Parameters, build)
