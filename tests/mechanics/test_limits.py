"""Timoshenko's beam, solved by other means."""

import numpy as np
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

from .scenes import arm_of, matrices_at_rest

OMEGA_0 = np.sqrt(1.0 / (0.2 * 0.5**4))  # sqrt(EI / (rho A l^4)) of the tests' link


def cantilever(effects):
    """Frequencies of one link with its joint locked."""
    M, K = matrices_at_rest(arm_of({"modes": 3}, effects=effects))
    return np.sqrt(eigh(K[1:, 1:], M[1:, 1:], eigvals_only=True))[:3]


def timoshenko_cantilever(count, gyration, shear):
    """Exact frequencies of a unit cantilever: state (w, psi, M, Q), exp of the state matrix, free end; no modes anywhere."""

    def determinant(omega):
        A = np.zeros((4, 4))
        A[0, 1], A[0, 3] = 1.0, 1 / shear
        A[1, 2] = 1.0
        A[2, 1], A[2, 3] = -(omega**2) * gyration**2, -1.0
        A[3, 0] = -(omega**2)
        return np.linalg.det(expm(A)[2:, 2:])

    grid = np.linspace(1.0, 70.0, 300)
    signs = np.sign([determinant(omega) for omega in grid])
    ends = np.flatnonzero(signs[:-1] != signs[1:])[:count]
    return np.array([brentq(determinant, grid[i], grid[i + 1], xtol=1e-13) for i in ends])


def test_timoshenko_against_the_exact_solution():
    """r = 0.05 l and kappa G A l^2 / EI = l^2 / (3 r^2): a stubby steel beam."""
    gyration, shear = 0.05, 1 / (3 * 0.05**2)
    effects = {"rotary_inertia": {"radius_of_gyration": gyration * 0.5}, "shear": {"stiffness": shear / 0.5**2}}
    exact = timoshenko_cantilever(3, gyration, shear) * OMEGA_0
    np.testing.assert_allclose(cantilever(effects), exact, rtol=1e-9)
    assert np.all(cantilever({"shear": effects["shear"]}) > exact * 1.0001)  # rotary inertia slows every mode
