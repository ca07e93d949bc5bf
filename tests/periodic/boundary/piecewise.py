"""Spectra of systems with piecewise constant stiffness by matrix exponentials: shares nothing with the engine, and takes microseconds."""

from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

from flexlin.periodic import Spectra


def piecewise(
    first: Callable, second: Callable, damping: np.ndarray, durations: Callable, error: float = 3e-12
) -> Callable[[np.ndarray], Spectra]:
    """Points (V,) or (V, P) -> spectra of y'' + D y' + K y = 0 with K = first(p), then second(p), each for durations(p) (V,)."""

    def spectra(points: np.ndarray) -> Spectra:
        n, product = len(damping), np.eye(2 * len(damping))
        for stiffness in (first, second):
            A = np.zeros((len(points), 2 * n, 2 * n))
            A[:, :n, n:], A[:, n:, :n], A[:, n:, n:] = np.eye(n), -stiffness(points), -damping
            product = expm(A * durations(points)[:, None, None]) @ product
        multipliers = np.linalg.eigvals(product).astype(complex)
        apart = np.abs(multipliers[:, :, None] - multipliers[:, None, :]) + 9 * np.eye(2 * n)
        return Spectra(np.log(multipliers), error + error / np.maximum(apart.min(axis=2), np.sqrt(error)))

    return spectra


def meissner(ratio: float, damping: float = 0.0) -> Callable[[np.ndarray], Spectra]:
    """y'' + d y' + (a +- q) y = 0, half of the period 2 pi each, q = ratio, the parameter is a."""

    def stiffness(sign: float) -> Callable:
        return lambda a: (a + sign * ratio)[:, None, None]

    return piecewise(stiffness(1.0), stiffness(-1.0), np.array([[damping]]), lambda a: np.full(len(a), np.pi))
