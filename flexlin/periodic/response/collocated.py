"""One collocation of a periodic system under a force: the states at the edges, and the polynomials between them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from flexlin.checks import Array, real_array
from flexlin.periodic.product.cyclic import cyclic_system
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import Tableau, collect_chunks, sample_at, solve_stages, weigh_stages
from flexlin.summary import represent

VectorFunction = Callable[[Array], Array]


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

    The force is one more column of A, which a constant state multiplies: z' = [[A, f], [0, 0]] z, z = [x; 1], gives Phi x + g over each
    segment. There is no solution where the singular value is one of rounding alone.
    """
    n, h, before = system.n, np.diff(grid), np.nextafter(grid[1:], -np.inf)

    def forced(t: Array, k: slice) -> Array:
        """h [[A, f], [0, 0]] at the stages, before a jump at the end of a segment."""
        t = np.minimum(t, before[k, None])
        A, force = sample_at(system.resolved, t), real_array("f", sample_at(f, t))
        out = np.zeros((*t.shape, n + 1, n + 1))
        out[..., :n, :n], out[..., :n, n] = A, force
        return out * h[k, None, None, None]

    def stages(t: Array, k: slice) -> Array:
        hA = forced(t, k)
        Y = solve_stages(hA, rule, np.broadcast_to(np.eye(n + 1), hA.shape))
        end = Y[:, -1] if rule.c[-1] == 1 else np.eye(n + 1) + weigh_stages(hA, rule, Y)
        return np.concatenate([Y, end[:, None]], axis=1)[..., :n, :]

    Y = collect_chunks(stages, grid, rule)
    Phi, g = Y[:, -1, :, :n], Y[:, -1, :, n:]
    cyclic = cyclic_system(Phi)
    sigma = float(np.linalg.svd(cyclic.closure, compute_uv=False)[-1])
    if sigma <= 4 * np.finfo(float).eps:
        return None, sigma, Phi
    x = cyclic.solve(g)[..., 0]
    moved = (Y[:, :-1, :, :n] @ x[:, None, :, None] + Y[:, :-1, :, n:])[..., 0] - x[:, None]
    legendre = legvander(2 * rule.c - 1, len(rule.c) - 1)
    slope = np.linalg.solve(rule.a @ legendre, moved) / h[:, None, None]
    return PiecewiseSolution(grid, x, slope), sigma, Phi


def integrate_legendre(theta: Array, count: int) -> Array:
    """int_0^theta P_m(2 s - 1) ds for m < count: (N, count)."""
    P = legvander(2 * theta - 1, count)
    m = np.arange(1, count)
    return np.column_stack([theta, (P[:, 2:] - P[:, :-2]) / (2 * (2 * m + 1))])
