"""One collocation of a periodic system under a force: the states at the edges, and the polynomials between them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from flexlin.checks import Array, real_array
from flexlin.periodic.product.cyclic import cyclic_system
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import (
    CHUNK_BYTES,
    Tableau,
    fold_samples,
    place_nodes,
    sample_at,
    solve_accelerations,
    solve_stages,
    weigh_stages,
)
from flexlin.summary import represent

VectorFunction = Callable[[Array], Array]
Affine = tuple[Array, Array, Callable[[Array], Array]]
"""Ends of the segments as Phi x + g (K, n, n), (K, n, 1), and the rates (K, s, n) at the stages as a function of the starts (K, n)."""


@dataclass(frozen=True)
class PiecewiseSolution:
    """The collocation polynomials: x(t_k + theta h_k) = start_k + h_k sum_m slope_km int_0^theta P_m."""

    edges: Array
    start: Array
    slope: Array

    __repr__ = represent

    def __call__(self, t: Array) -> Array:
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.start) - 1)
        h = np.diff(self.edges)[k]
        integral = h[:, None] * integrate_legendre((t - self.edges[k]) / h, self.slope.shape[1])
        return self.start[k] + (integral[:, None, :] @ self.slope[k])[:, 0]


def solve_periodic(
    system: PeriodicSystem, f: VectorFunction, grid: Array, rule: Tableau
) -> tuple[PiecewiseSolution | None, float, Array]:
    """Solve for the states at the edges; returns the solution, the smallest singular value of the closure, and Phi.

    There is no solution where that singular value is one of rounding alone.
    """
    h = np.diff(grid)
    t = np.minimum(place_nodes(grid, rule.c), np.nextafter(grid[1:], -np.inf)[:, None])
    force = real_array("f", sample_at(f, t))
    coefficients = system.resolved
    if isinstance(coefficients, ResolvedCompanion):
        Phi, g, rates = collocate_second_order(coefficients, t, h, force, rule)
    else:
        Phi, g, rates = collocate_first_order(sample_at(coefficients, t), h, force, rule)
    cyclic = cyclic_system(Phi)
    sigma = float(np.linalg.svd(cyclic.closure, compute_uv=False)[-1])
    if sigma <= 4 * np.finfo(float).eps:
        return None, sigma, Phi
    x = cyclic.solve(g)[..., 0]
    return PiecewiseSolution(grid, x, invert_legendre(rule) @ rates(x)), sigma, Phi


def collocate_first_order(A: Array, h: Array, force: Array, rule: Tableau) -> Affine:
    """Y_i = x + h sum_j a_ij (A_j Y_j + f_j), for A (K, s, n, n) and f (K, s, n)."""
    n, h = A.shape[-1], h[:, None, None, None]
    hA, hf = A * h, force[..., None] * h
    eye = np.broadcast_to(np.eye(n), A.shape)
    right = np.concatenate([eye, np.einsum("ij,kjnr->kinr", rule.a, hf)], axis=-1)
    parts = chunks(len(A), len(rule.c) * n)
    Y = np.concatenate([solve_stages(hA[k], rule, right[k]) for k in parts])
    if rule.c[-1] == 1:
        Phi, g = Y[:, -1, :, :n], Y[:, -1, :, n:]
    else:
        step = weigh_stages(hA, rule, Y)
        Phi, g = np.eye(n) + step[..., :n], step[..., n:] + (rule.b[:, None, None] * hf).sum(axis=1)

    def rates(x: Array) -> Array:
        stages = (Y[..., :n] @ x[:, None, :, None] + Y[..., n:])[..., 0]
        return np.linalg.solve(rule.a, stages - x[:, None]) / h[..., 0]

    return Phi, g, rates


def collocate_second_order(coefficients: ResolvedCompanion, t: Array, h: Array, force: Array, rule: Tableau) -> Affine:
    """The same in the accelerations w = v', half as many unknowns: y' = v + f_y, M (w - f_v) + D v + K y = 0.

        v_i = v + h sum_j a_ij w_j,   y_i = y + h c_i v + h sum_j a_ij (f_y + h sum_k a_jk w_k)_j

    Source: Hairer, Norsett, Wanner, Solving ODEs I, II.14 (Nystrom methods from collocation).
    """
    s, n, each = len(rule.c), force.shape[-1] // 2, h[:, None, None]
    shift = each * (rule.a @ force[..., :n])
    parts, found = chunks(len(t), s * n), []
    for k in parts:
        M, D, K = (fold_samples(values, t[k]) for values in coefficients.sample(t[k].ravel()))
        pushed = M @ force[k, :, n:, None] - K @ shift[k, ..., None]
        right = np.concatenate([-K, -D - (each[k] * rule.c[:, None])[..., None] * K, pushed], axis=-1)
        found.append(solve_accelerations(M, D, K, h[k], rule, right))
    W = np.concatenate(found)
    flat = W.reshape(len(t), s, -1)
    ends = [
        (weights @ flat).reshape(len(t), n, 2 * n + 1) * size
        for weights, size in ((rule.b @ rule.a, each**2), (rule.b, each))
    ]
    ends[0][..., -1] += h[:, None] * (rule.b @ force[..., :n])
    whole = np.concatenate(ends, axis=1)
    Phi, diagonal = whole[..., :-1].copy(), np.arange(2 * n)
    Phi[:, diagonal, diagonal] += 1
    Phi[:, diagonal[:n], diagonal[n:]] += h[:, None]

    def rates(x: Array) -> Array:
        w = (W[..., :-1] @ x[:, None, :, None])[..., 0] + W[..., -1]
        return np.concatenate([x[:, None, n:] + each * (rule.a @ w) + force[..., :n], w], axis=-1)

    return Phi, whole[..., -1:], rates


def chunks(segments: int, unknowns: int) -> list[slice]:
    """The segments, as many at a time as keep their stage matrices within CHUNK_BYTES."""
    size = max(1, CHUNK_BYTES // (8 * unknowns**2))
    return [slice(k, k + size) for k in range(0, segments, size)]


def invert_legendre(rule: Tableau) -> Array:
    """The matrix from stage values to coefficients of P_m on [0, 1]."""
    return np.linalg.inv(legvander(2 * rule.c - 1, len(rule.c) - 1))


def integrate_legendre(theta: Array, count: int) -> Array:
    """int_0^theta P_m(2 s - 1) ds for m < count: (N, count)."""
    P = legvander(2 * theta - 1, count)
    m = np.arange(1, count)
    return np.column_stack([theta, (P[:, 2:] - P[:, :-2]) / (2 * (2 * m + 1))])
