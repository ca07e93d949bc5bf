"""Geometric stiffening of one link with payload on a hub of some radius, against its closed formula."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad

from flexlin.mechanics import clamped_free

from .scenes import LINK, arm_of


@pytest.mark.parametrize("radius", [0.0, 0.08])
@pytest.mark.parametrize("angle", [0.0, 0.9])
def test_stiffness_of_a_turning_link(radius, angle):
    """K_L(2, 2) = EI k11 + q'^2 (G + r H - Bw) - g sin(q) H, with G, H by adaptive quadrature of a closed-form mode.

    S = m_E int X'^2, G = 1/2 rhoA int (l^2 - x^2) X'^2 + l S, H = rhoA int (l - x) X'^2 + S. Source: Simo, Vu-Quoc (1987).
    """
    length, density, stiffness = LINK["length"], LINK["mass_per_length"], LINK["bending_stiffness"]
    payload, rate, g = 0.07, 4.0, 9.81
    beta = 1.8751040687119612
    sigma = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))

    def slope(x):
        z = beta * x / length
        return beta / length * (np.sinh(z) + np.sin(z) - sigma * (np.cosh(z) - np.cos(z)))

    def integral(f):
        return quad(lambda x: f(x) * slope(x) ** 2, 0, length, epsabs=1e-13, epsrel=1e-13)[0]

    S = payload * integral(lambda x: 1.0)
    G = density / 2 * integral(lambda x: length**2 - x**2) + length * S
    H = density * integral(lambda x: length - x) + S
    Bw = density * length + 4 * payload
    effects = {"gravity": {}, "payload": {"mass": payload}, "hub": {"radius": radius}, "geometric_stiffening": {}}
    arm = arm_of({"modes": 1}, effects=effects)
    K = ca.Function("K", [arm.s, arm.s_dot, arm.s_ddot], [ca.jacobian(arm.residual, arm.s)[1, 1]])
    expected = stiffness / length**3 * beta**4 + rate**2 * (G + radius * H - Bw) - g * np.sin(angle) * H
    assert float(K([angle, 0], [rate, 0], [0, 0])) == pytest.approx(expected, rel=1e-10)
    assert clamped_free(1).beta[0] == pytest.approx(beta, rel=1e-15)
