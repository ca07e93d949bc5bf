"""Exponents of a constant system: the eigenvalues of its matrix, with their errors."""

import numpy as np

from flexlin.checks import Array
from flexlin.lapack import complex_schur
from flexlin.periodic.product.balancing import balance_factors
from flexlin.periodic.product.perturbation import EPS, bound_pairs, separate_triangular
from flexlin.periodic.resolved.companion import couple_uncertainty
from flexlin.periodic.system import PeriodicSystem

BACKWARD = 3.0
"""Roundings of |A| that the QR algorithm commits, beyond those of the entries."""


def solve_constant(system: PeriodicSystem) -> tuple[Array, Array]:
    """Eigenvalues of A (n,) by falling real part, in 1/s, and bounds on their errors (n,).

    |d lambda_i| <= eps |A| |l_i| |r_i|,   l_i^H r_i = 1, and what pairs of eigenvalues do to each other
    """
    A = system.resolved(np.zeros(1))
    unit = 2.0 ** np.frexp(np.abs(A).max())[1]  # of 1/s, for squares of entries to be numbers
    A, scale = balance_factors(A / unit)
    T, Q = complex_schur(A[0])
    X, shared = separate_triangular(T)
    right, left = Q @ X, np.linalg.solve(X, Q.conj().T)
    size = BACKWARD * EPS * np.linalg.norm(A[0])
    coupling = size * np.outer(np.linalg.norm(left, axis=1), np.linalg.norm(right, axis=0))
    uncertain = couple_uncertainty(system.resolved, np.zeros(1), (left / scale)[None], (scale[:, None] * right)[None])
    coupling += uncertain[0] / unit
    values, own = np.diagonal(T), np.diagonal(coupling)
    errors = own + bound_pairs(coupling, own, np.abs(values[:, None] - values), shared)
    order = np.argsort(-values.real, kind="stable")
    return unit * values[order], unit * errors[order]
