"""Logs of eigenvalues."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import wrap_angle
from flexlin.periodic.product.spectrum import product_logs, solve_product

__all__ = ["find_log_eigenvalues", "product_logs", "solve_product"]

TINY = float(np.finfo(float).tiny)


def find_log_eigenvalues(P: Array) -> Array:
    """Logs of the eigenvalues of matrices (..., n, n), imaginary parts in (-pi, pi]."""
    values = np.linalg.eigvals(P)
    size = np.maximum(np.abs(values), TINY)
    return np.log(size) + 1j * wrap_angle(np.angle(values))
