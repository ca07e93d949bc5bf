"""The Lyapunov inequality over a whole period: values at samples, and between them a bound from the coefficients."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.certificate.panels import CommonPanels
from flexlin.periodic.chebyshev import chebyshev_basis, chebyshev_coefficients, chebyshev_nodes

SAMPLES = (65, 257, 1025)
"""Equally spaced samples of a panel, ends included, that are tried."""
STRIDE = 8
"""Samples from one whose eigenvalues are computed in any case to the next."""
BESIDE, CLOSE = 0.01, 1e-9
"""Share of the range of largest eigenvalues in which neighbours are solved too; relative distance of a bound above all."""
NEAR = 1e-3
"""Relative distance of a bound that need not be close."""
SHARE = 0.05
"""Share of the margin that the bound between samples may cost."""
LEAST = 1e-12
"""Of the margin: what a certificate must tolerate, or it says more of rounding than of the loop."""
SKEWED = 1e6
"""Condition of L, in units in which X has a diagonal of ones, beyond which rounding may say anything."""
ROUNDINGS = 8.0
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Proof:
    """X' + A' X + X A <= -margin X, in 1/s, and the spectral norm of a change of A, in 1/s, that leaves it negative; margin <= 0: none."""

    margin: float
    tolerates: float


def prove(panels: CommonPanels) -> Proof:
    """Bound the margin from below.

    In coordinates z = L' x, L L' = mean X, with R = X' + A' X + X A:

        R(t) + mu X(t) <= -(what A's error and rounding can add)

    holds at the samples, and between two of them because a matrix polynomial p lies within h^2/8 max |p''| of its chord, where
    |p''| <= sum_k |c_k| k^2 (k^2 - 1) / 3 (Markov). Where X grows from one panel to the next, the growth is paid from the margin.
    """
    L = np.linalg.cholesky(mean_of(panels))
    if np.linalg.cond(L / np.sqrt((L**2).sum(axis=1))[:, None]) > SKEWED:
        return Proof(-np.inf, 0.0)
    A = L.T @ panels.A @ np.linalg.inv(L.T)
    X = np.linalg.solve(L, np.swapaxes(np.linalg.solve(L, panels.X), -1, -2))
    unknown = np.linalg.norm(np.abs(L.T) @ panels.error @ np.abs(np.linalg.inv(L.T)))
    best = Proof(-np.inf, 0.0)
    for count in SAMPLES:
        found, lost = bound_margin(panels.edges, A, X, float(unknown), count)
        best = max(best, found, key=lambda one: one.margin)
        if lost <= SHARE * max(found.margin, 0.0) or found.margin + lost <= 0 or found.margin == -np.inf:
            break
    tolerates = best.tolerates / float(np.linalg.cond(L))
    return Proof(best.margin, tolerates) if tolerates > LEAST * best.margin else Proof(-np.inf, 0.0)


def mean_of(panels: CommonPanels) -> Array:
    """The mean of X over the period (n, n)."""
    even = np.arange(0, panels.X.shape[1], 2)
    share = np.diff(panels.edges) / panels.edges[-1]
    return np.einsum("p,k,pkij->ij", share, 1 / (1 - even**2.0), panels.X[:, ::2])


def bound_margin(edges: Array, A: Array, X: Array, unknown: float, count: int) -> tuple[Proof, float]:
    """Return the margin proved with so many samples a panel, and what the bound between samples costs."""
    half = np.diff(edges)[:, None, None, None] / 2
    slope = np.polynomial.chebyshev.chebder(X, axis=1) / half if X.shape[1] > 1 else np.zeros_like(X)
    degree = A.shape[1] + X.shape[1] - 1
    R = chebyshev_coefficients(flat(sum_terms(A, X, slope, chebyshev_nodes(degree))))
    h = 2.0 / (count - 1)
    bends = [h**2 / 8 * bend(one).max() for one in (R, flat(X))]
    u = np.linspace(-1.0, 1.0, count)
    values, size = sum_terms(A, X, slope, u), evaluate(X, u)
    eye = np.broadcast_to(np.eye(size.shape[-1]), size.shape)
    least, most = (bound_ratio(part, eye, NEAR) + bends[1] for part in (-size, size))
    least = -least
    if not least > 0:
        return Proof(-np.inf, 0.0), np.inf
    largest_A = float(np.linalg.norm(evaluate(A, u), axis=(-2, -1)).max())
    rounding = ROUNDINGS * len(A[0, 0]) * EPS * (2 * largest_A * most + float(np.abs(evaluate(slope, u)).max()))
    known = 2 * unknown * most + rounding
    some = slice(None, None, STRIDE)
    first = float(largest_ratios(values[:, some] + known * eye[:, some], size[:, some]).max())  # not above that of all
    mu = bound_ratio(values + (known + bends[0] + max(-first, 0.0) * bends[1]) * eye, size)
    ends = evaluate(X, np.array([-1.0, 1.0]))
    paid = np.log(np.maximum(largest_ratios(ends[:, 0], np.roll(ends[:, 1], 1, axis=0)), 1.0))
    margin = -mu - float(paid.sum()) / float(edges[-1])
    return Proof(margin, max(margin, 0.0) / 2 * float(np.sqrt(least / most))), mu - first


def sum_terms(A: Array, X: Array, slope: Array, u: Array) -> Array:
    """X' + A' X + X A at u of each panel, (P, U, n, n)."""
    product = evaluate(X, u) @ evaluate(A, u)
    return evaluate(slope, u) + product + np.swapaxes(product, -1, -2)


def evaluate(coefficients: Array, u: Array) -> Array:
    """Polynomials of each panel at u (U,): (P, U, n, n)."""
    return np.einsum("uk,pkij->puij", chebyshev_basis(u, coefficients.shape[1]), coefficients, optimize=True)


def flat(values: Array) -> Array:
    """Matrices as rows."""
    return values.reshape(*values.shape[:2], -1)


def bend(coefficients: Array) -> Array:
    """A bound on the second derivative of each panel's polynomial in [-1, 1], by |T_k''| <= k^2 (k^2 - 1) / 3 (P,)."""
    k = np.arange(coefficients.shape[1])
    return np.linalg.norm(coefficients, axis=2) @ (k**2 * (k**2 - 1.0) / 3)


def largest_ratios(R: Array, X: Array) -> Array:
    """The largest eigenvalue of L^-1 R L^-T with L L' = X > 0, at each sample: the least mu with R <= mu X."""
    inverse = np.linalg.inv(np.linalg.cholesky(X))
    return np.linalg.eigvalsh(inverse @ R @ np.swapaxes(inverse, -1, -2))[..., -1]


def bound_ratio(R: Array, X: Array, above: float = 0.0) -> float:
    """An upper bound mu, R <= mu X at all samples (P, U, n, n), hardly above the least, or above it by the share `above`.

    Every eighth sample is solved, and those beside the largest; that no other one exceeds the bound is proved by the Cholesky factors of
    mu X - R, which take a tenth of the time of its eigenvalues.
    """
    count = R.shape[1]
    known = largest_ratios(R[:, ::STRIDE], X[:, ::STRIDE])
    most = known.max()
    if above and is_bound(float(most + above * abs(most)), R, X):
        return float(most + above * abs(most))
    panel, high = np.nonzero(known >= most - BESIDE * (most - known.min()))
    beside = np.clip(STRIDE * high[:, None] + np.arange(1 - STRIDE, STRIDE), 0, count - 1)
    most = largest_ratios(R[panel[:, None], beside], X[panel[:, None], beside]).max()
    bound = float(most + CLOSE * abs(most))
    return bound if is_bound(bound, R, X) else float(largest_ratios(R, X).max())


def is_bound(mu: float, R: Array, X: Array) -> bool:
    """Whether mu X - R is positive definite at every sample."""
    try:
        np.linalg.cholesky(mu * X - R)
    except np.linalg.LinAlgError:
        return False
    return True
