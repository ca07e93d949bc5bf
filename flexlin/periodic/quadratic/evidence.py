"""Whether a solution is the stabilising one, and how wrong it is: its residual, carried through the closed loop's Lyapunov equation."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.collocated_lyapunov import measure_states
from flexlin.periodic.quadratic.scattering import symmetrize

ROUNDING = np.finfo(float).eps / 4
"""Rounding of a sum of products, relative to the sum of their sizes: 3 times the root mean square that was seen."""
SAFETY = 3.0
"""Factor on the errors that are found."""
FLOOR = 1e-3
"""Least weight of a state in W, relative to the largest, in units in which X has a diagonal of ones."""
UNRESOLVED, HIDDEN = 0.05, 10.0
"""Share of the last quarter of the harmonics from which on E, if above rounding, is not resolved, and the factor that it then gets."""
PROBE = 20
"""Seed of the signs that rounding is given."""


@dataclass(frozen=True)
class Evidence:
    """Estimates of |X error| / max |X|, of its part that is not rounding, and of |K error| / max |K|; the largest residual."""

    error: float
    method_error: float
    gain_error: float
    residual: float


def weigh_parts(parts: list[Array], X: Array, residual: Array, to_gain: Array, gain: Array) -> Evidence:
    """Return what the parts of E say: that of the residual as it was computed, then those of what it might be rounded by.

    to_gain: R^-1 B'. All (N, ., .) at the same times.
    """
    if np.abs(parts[0]).max() > max(np.abs(part).max() for part in parts[1:]) and find_tail(parts[0]) > UNRESOLVED:
        parts = [HIDDEN * parts[0], *parts[1:]]
    size, height = float(np.abs(X).max()) or 1.0, float(np.abs(gain).max()) or 1.0
    product = 8 * ROUNDING * float((np.abs(to_gain) @ np.abs(X)).max())
    return Evidence(
        SAFETY * add_up(parts) / size + 8 * ROUNDING,
        SAFETY * float(np.abs(parts[0]).max()) / size,
        (SAFETY * add_up([to_gain @ E for E in parts]) + product) / height,
        float(np.abs(residual).max()),
    )


def find_tail(X: Array) -> float:
    """Return the size of the last quarter of the harmonics of samples (N, n, n), relative to the largest entry."""
    size = np.abs(np.fft.rfft(X, axis=0)).max(axis=(1, 2))
    return float(size[-(len(size) // 4) :].max() / (size.max() or 1.0))


def add_up(parts: list[Array]) -> float:
    """Return the largest entry of the first part, plus the largest of all others."""
    first, *others = (float(np.abs(part).max()) for part in parts)
    return first + max(others)


def draw_roundings(A: Array, S: Array, Q: Array, X: Array, rate: Array) -> list[Array]:
    """Return what rounding may make of the residual, with signs that are the same at all times, and with signs that change."""
    signs = np.random.default_rng(PROBE).choice([-1.0, 1.0], (2, *X.shape))
    signs[0] = signs[0, 0]
    return [draw_rounding(A, S, Q, X, rate, sign) for sign in signs]


def draw_rounding(A: Array, S: Array, Q: Array, X: Array, rate: Array, signs: Array) -> Array:
    """Return what rounding may make of X' + A' X + X A - (X S) X + Q, with the given signs.

    What is lost in X S is multiplied by X: where X S is a small difference, as in cheap control, that matters less than its size.
    """
    sizes = np.abs(rate) + np.abs(Q) + np.abs(X @ S) @ np.abs(X) + 2 * np.abs(X) @ np.abs(A)
    inner = (np.abs(X) @ np.abs(S)) * np.swapaxes(signs, 1, 2)
    return ROUNDING * symmetrize(sizes * signs + 2 * inner @ X)


def weigh(sizes: Array, X: Array) -> Array:
    """Return the diagonal of W (n,) with -W <= F(t) <= W for all |F(t)| <= sizes (N, n, n).

    By Gershgorin's theorem, in units d in which X has about a diagonal of ones:  W_i = max over t of sum_j |F_ij| d_i / d_j.
    """
    units = measure_states(X)
    W = (sizes / units).sum(axis=2).max(axis=0) / units
    return np.asarray(np.maximum(W, FLOOR * W.max()) * units**2)
