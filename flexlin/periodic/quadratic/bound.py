"""How wrong a stabilising solution may be: its residual, carried through the closed loop's Lyapunov equation."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.quadratic.collocated_lyapunov import CollocatedLyapunov
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.scattering import transpose

ROUNDING = 8 * np.finfo(float).eps
"""Rounding of a sum of products, relative to the sum of their sizes."""
BETWEEN = 1.5
"""Factor for what the residual may be between the times at which it is looked at."""
FLOOR = 1e-3
"""Least weight of a state in W, relative to the largest, in units in which X has a diagonal of ones."""
WEIGHING = 1e-3
"""Relative accuracy to which Y is asked for."""
MOST_LEFT, MOST_CURVED = 0.5, 0.2
"""Largest share of W that Y may miss, and the largest curvature q, up to which the bound is used."""


@dataclass(frozen=True)
class ErrorBound:
    """Bounds on |X error| / max |X|, on |K error| / max |K|; and the largest residual."""

    error: float
    gain_error: float
    residual: float


def bound_error(problem: LinearQuadratic, X: FourierSeries, lyapunov: CollocatedLyapunov) -> ErrorBound:
    """Bound the distance between X and the stabilising solution X + E, and prove the loop of X stable on the way.

        E' + Ac' E + E Ac - E S E + F = 0,   Ac = A - S X,   F = X' + A' X + X A - X S X + Q

    Let -W <= F <= W with a constant diagonal W > 0, and -(Y' + Ac' Y + Y Ac) >= (1 - theta) W. By Lyapunov's theorem the loop
    is stable if Y > 0 at one time. Then |v' E w|^2 <= k^2 (v' Y v) (w' Y w) with k = (1 - theta)^-1 2 / (1 + sqrt(1 - 4 q)),
    the fixed point of k = (1 + k^2 |Y^(1/2) S Y^(1/2)| |W^(-1/2) Y W^(-1/2)|) / (1 - theta): E = 0 is iterated to E, and -k Y <= E <= k Y
    is kept. For K that gives |(R^-1 B' E)_aj|^2 <= k^2 (R^-1 B' Y B R^-1)_aa Y_jj.
    Assumes that F is smooth between 2 N + 1 times that lie on none of the N nodes.
    Raises: ToleranceNotReached when Y does not prove stability.
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 4 (periodic Lyapunov inequality).
    """
    T, N = X.period, len(X.coefficients)
    t = T * (np.arange(2 * N + 1) + 0.3819) / (2 * N + 1)
    A, S, Q = problem.reduced(t)
    values, rate = X(t), X(t, 1)
    loop, by_A = A - S @ values, values @ A
    residual = np.abs(rate + by_A + transpose(by_A) - values @ S @ values + Q)
    sizes = np.abs(rate) + sum_sizes(A, S, Q, values)
    W, scale = weigh(BETWEEN * residual + ROUNDING * sizes, values)
    Y = FourierSeries.through(lyapunov.solve(np.broadcast_to(-np.diag(W), (N, *values.shape[1:])), WEIGHING), T)
    at, drift = Y(t), Y(t) @ loop
    missed = (Y(t, 1) + drift + transpose(drift) + np.diag(W)) / np.sqrt(np.outer(W, W))
    theta = float(np.linalg.norm(missed, 2, axis=(1, 2)).max())
    relative = at / np.sqrt(np.outer(W, W))
    curved = float((np.trace(S @ at, axis1=1, axis2=2) * np.trace(relative, axis1=1, axis2=2)).max()) / (1 - theta) ** 2
    if theta > MOST_LEFT or curved > MOST_CURVED or np.linalg.eigvalsh(relative[0])[0] <= 0:
        raise ToleranceNotReached(
            "the closed loop was not proved stable", got=f"a share of {theta:.2g}, curvature {curved:.2g}"
        )
    spread = at * (2 / (1 + np.sqrt(1 - 4 * curved)) / (1 - theta))
    return ErrorBound(*relate(problem, t, values, spread), float(residual.max()))


def sum_sizes(A: Array, S: Array, Q: Array, X: Array) -> Array:
    """Return |X| |A| + |A|' |X| + |X| |S| |X| + |Q|, entry by entry."""
    X, product = np.abs(X), np.abs(X) @ np.abs(A)
    return np.asarray(product + transpose(product) + X @ np.abs(S) @ X + np.abs(Q))


def weigh(sizes: Array, X: Array) -> tuple[Array, Array]:
    """Return a diagonal W with -W <= F(t) <= W for all |F(t)| <= sizes (N, n, n), and the states' scale.

    By Gershgorin's theorem, in units in which X has about a diagonal of ones:  W_i = max over t of sum_j |F_ij| d_i / d_j.
    """
    diagonal = np.sqrt(np.diagonal(X, axis1=1, axis2=2).clip(0.0).max(axis=0))
    scale = np.maximum(diagonal, 1e-8 * diagonal.max() + np.finfo(float).tiny)
    W = (sizes / scale).sum(axis=2).max(axis=0) / scale
    return np.maximum(W, FLOOR * W.max()) * scale**2, scale


def relate(problem: LinearQuadratic, t: Array, X: Array, spread: Array) -> tuple[float, float]:
    """Return the errors of X and K, relative to their largest entries, for |v' E w|^2 <= (v' spread v) (w' spread w)."""
    of_states = np.diagonal(spread, axis1=1, axis2=2)
    size = float(np.abs(X).max())
    to_gain = np.linalg.solve(problem.R(t), transpose(problem.B(t)))
    of_inputs = np.einsum("tai,tij,taj->ta", to_gain, spread, to_gain)
    K = problem.gain(t, X)
    of_rounding = ROUNDING * (np.abs(to_gain) @ np.abs(X)).max()
    wrong = np.sqrt(of_inputs.max(axis=1) * of_states.max(axis=1)).max() + of_rounding
    return float(of_states.max() / size) + ROUNDING, float(wrong / (np.abs(K).max() or 1.0))
