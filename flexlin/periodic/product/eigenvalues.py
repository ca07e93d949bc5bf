"""Eigenvalues of a long product of matrices, taken from the factors: 1e-1300 and 1e+1300 come out beside each other."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import wrap_angle
from flexlin.periodic.product.balancing import balance_factors, count_groupings, group_factors
from flexlin.periodic.product.perturbation import spectrum_motion
from flexlin.periodic.product.schur import periodic_schur
from flexlin.periodic.product.sweeps import TINY


def product_logs(factors: Array) -> Array:
    """Logs of the eigenvalues of F_(K-1) ... F_0 (n,), by falling real part, imaginary parts in (-pi, pi]; the product is not formed.

    Parameters: factors (K, n, n) real, the first acts first.
    """
    logs = periodic_schur(group_factors(balance_factors(factors)[0])).logs
    return np.asarray(logs[np.argsort(-logs.real, kind="stable")])


def solve_product(factors: Array) -> tuple[Array, Array]:
    """The logs as `product_logs` gives them, and how far rounding moves each (n,)."""
    even, _ = balance_factors(factors)
    groups, rounds = count_groupings(even)
    form = periodic_schur(groups)
    rounding = spectrum_motion(form, groups, groups, None, 2.0**rounds).rounding
    order = np.argsort(-form.logs.real, kind="stable")
    return form.logs[order], rounding[order]


def find_log_eigenvalues(P: Array) -> Array:
    """Logs of the eigenvalues of matrices (..., n, n), imaginary parts in (-pi, pi]."""
    values = np.linalg.eigvals(P)
    size = np.maximum(np.abs(values), TINY)
    return np.log(size) + 1j * wrap_angle(np.angle(values))
