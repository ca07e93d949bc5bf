"""Every coefficient of the engine against daceypy's truncated polynomials, an independent program in C++."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

from flexlin.mechanics import five_bar

daceypy = pytest.importorskip("daceypy")
pytestmark = pytest.mark.peers

LEFT, RIGHT, BASE, ORDER = (0.3, 0.5), (0.35, 0.45), 0.25, 7
LOOP = five_bar(BASE, LEFT, RIGHT)
S0 = LOOP.close([2.2, -1.7, 0.9, 1.4, 0.1, 0.5], (4, 5))


def tips(q):
    """Both tips of the 5-bar in daceypy's polynomials."""
    places = []
    for origin, (a, b), (first, bend) in ((0.0, LEFT, q[:2]), (BASE, RIGHT, q[2:])):
        both = first + bend
        places += [origin + a * first.cos() + b * both.cos(), a * first.sin() + b * both.sin()]
    return places


def test_inverse_kinematics_of_the_5_bar():
    """Newton's method with the constant V gains one order a step."""
    DA = daceypy.DA
    DA.init(ORDER, 2)
    c = LOOP.taylor(S0, (4, 5), ORDER)
    slope = ca.Function("V", [LOOP.s], [ca.jacobian(LOOP.gap, LOOP.s)[:, :4]])
    W = np.linalg.inv(slope(S0).full())
    x, q = [S0[4] + DA(1), S0[5] + DA(2)], [DA(1) * 0 + angle for angle in S0[:4]]
    for _ in range(ORDER):
        gap = [x[i % 2] - tip for i, tip in enumerate(tips(q))]
        q = [q[i] - sum(float(W[i, j]) * gap[j] for j in range(4)) for i in range(4)]
    powers = c.polynomial.indices.powers
    judge = np.array([[angle.getCoefficient(alpha.tolist()) for angle in q] for alpha in powers])
    for k in range(ORDER + 1):
        where = c.polynomial.indices.degree(k)
        assert_allclose(c.polynomial.coefficients[where], judge[where], atol=1e-12 * np.abs(judge[where]).max())
