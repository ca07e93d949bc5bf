"""A window of time: several collocation steps at once, whose linear equations are factored in one batch."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.periodic.transition.gauss import Tableau, radau


@dataclass(frozen=True)
class Path:
    """A motion on a window: states x (K + 1, 2n) at the edges; y, v = y', w = y'' (K, s, n) at the stages of each step."""

    x: Array
    y: Array
    v: Array
    w: Array

    @property
    def finite(self) -> bool:
        """Whether every number is one."""
        return bool(np.isfinite(self.x).all() and np.isfinite(self.w).all())

    @property
    def stages(self) -> tuple[Array, Array, Array]:
        """y, y', y'' (K s, n) of all stages."""
        n = self.w.shape[-1]
        return self.y.reshape(-1, n), self.v.reshape(-1, n), self.w.reshape(-1, n)

    def first(self, count: int) -> "Path":
        """The first steps of it."""
        return Path(self.x[: count + 1], self.y[:count], self.v[:count], self.w[:count])


@dataclass(frozen=True)
class Grid:
    """Steps between increasing edges (K + 1,), with the stages of Radau's method in each."""

    edges: Array
    stages: int

    @property
    def rule(self) -> Tableau:
        """The Radau IIA method: L-stable, order 2 s - 1; its last stage is the step's end."""
        return radau(self.stages)

    @property
    def count(self) -> int:
        """The number of steps."""
        return len(self.edges) - 1

    @property
    def h(self) -> Array:
        """The lengths of the steps (K,)."""
        return np.diff(self.edges)

    @property
    def times(self) -> Array:
        """The times (K, s) of all stages."""
        return self.edges[:-1, None] + self.h[:, None] * self.rule.c

    def first(self, count: int) -> "Grid":
        """The first steps of it."""
        return Grid(self.edges[: count + 1], self.stages)

    def path(self, x: Array, w: Array) -> Path:
        """The motion that states at the edges and accelerations at the stages make.

        v_i = v_0 + h sum_j a_ij w_j,   y_i = y_0 + h c_i v_0 + h^2 sum_j (a^2)_ij w_j
        """
        h, (c, a), n = self.h[:, None, None], (self.rule.c, self.rule.a), w.shape[-1]
        y, v = x[:-1, None, :n], x[:-1, None, n:]
        return Path(x, y + h * c[:, None] * v + h * h * ((a @ a) @ w), v + h * (a @ w), w)

    def rest(self, y: Array) -> Path:
        """The arm at rest in y (n,) at all times."""
        zeros = np.zeros((self.count, self.stages, len(y)))
        return self.path(np.tile(np.append(y, np.zeros(len(y))), (self.count + 1, 1)), zeros)

    def coasting(self, x: Array) -> Path:
        """The arm that goes on from a state (2n,) with the rates it has."""
        n = len(x) // 2
        edges = np.tile(x, (self.count + 1, 1))
        edges[:, :n] += np.outer(self.edges - self.edges[0], x[n:])
        return self.path(edges, np.zeros((self.count, self.stages, n)))


class Window:
    """The linear equations M w + D v + K y = -F on a grid, collocated in the accelerations w.

    M, D, K: (K s, n, n) at the stages; often: whether they are solved for several F, which pays for the inverse.
    Source: Hairer, Norsett, Wanner, Solving ODEs I, II.14; Solving ODEs II, IV.8.
    """

    def __init__(self, grid: Grid, M: Array, D: Array, K: Array, often: bool = True):
        shape = (grid.count, grid.stages, *M.shape[1:])
        self.grid, self.M, self.D, self.K = grid, M.reshape(shape), D.reshape(shape), K.reshape(shape)
        rule, h, n = grid.rule, grid.h[:, None, None, None], M.shape[-1]
        self._left = stage_matrix(self.M, h * self.D, h * h * self.K, rule)
        self._inverse = np.linalg.inv(self._left) if often else None
        right = np.concatenate([self.K, self.D + h * rule.c[:, None, None] * self.K], axis=-1)
        self._right = right.reshape(grid.count, -1, 2 * n)
        self._by_start: Array | None = None

    def _solve(self, F: Array) -> tuple[Array, Array]:
        """The accelerations (K, s n, 1) that F (K, s n, 1) asks for where a step begins at rest, and (K, s n, 2n) by its start."""
        if self._inverse is not None:
            if self._by_start is None:
                self._by_start = -(self._inverse @ self._right)
            return -(self._inverse @ F), self._by_start
        if self._by_start is not None:
            return -np.linalg.solve(self._left, F), self._by_start
        both = -np.linalg.solve(self._left, np.concatenate([self._right, F], axis=-1))
        self._by_start = both[..., :-1]
        return both[..., -1:], self._by_start

    @lazy
    def _transition(self) -> Array:
        """The transition matrices (K, 2n, 2n) of the steps."""
        assert self._by_start is not None
        n, diagonal = self.M.shape[-1], np.arange(2 * self.M.shape[-1])
        Phi = self._ends(self._by_start.reshape(*self.M.shape[:3], 2 * n))
        Phi[:, diagonal, diagonal] += 1
        Phi[:, diagonal[:n], diagonal[n:]] += self.grid.h[:, None]
        return Phi

    def _ends(self, w: Array) -> Array:
        """What accelerations (K, s, n, ...) of the stages add to the states at the end of each step, (K, 2n, ...)."""
        b, a, count, n = self.grid.rule.b, self.grid.rule.a, self.grid.count, w.shape[2]
        h = self.grid.h[:, None, None]
        added = np.stack([b @ a, b]) @ w.reshape(count, self.grid.stages, -1)
        added *= np.concatenate([h * h, h], axis=1)
        return added.reshape(count, 2 * n, *w.shape[3:])

    def corrected(self, path: Path, start: Array, F: Array) -> tuple[Path, Array]:
        """A Newton step from a path whose residuals are F (K s, n) to one that begins at `start`; and the change of x (K + 1, 2n)."""
        count, n = self.grid.count, F.shape[-1]
        free, by_start = self._solve(F.reshape(count, -1, 1))
        added = self._ends(free.reshape(count, -1, n))
        step = np.empty((count + 1, 2 * n))
        step[0] = start - path.x[0]
        for k in range(count):
            step[k + 1] = self._transition[k] @ step[k] + added[k]
        w = path.w + (free + by_start @ step[:-1, :, None]).reshape(path.w.shape)
        return self.grid.path(path.x + step, w), step

    def local_errors(self, path: Path, before: Array) -> Array:
        """An estimate (K, 2n) of each step's error: how far the stages miss the rate at the step's beginning, filtered.

            e = (I - g h J)^-1 g h (x'(0) - sum_j l_j(0) x'_j),   g = 1 / (s + 1)

        It is O(h^(s + 1)), the order of the motion between the edges. before: the acceleration (n,) at the beginning of the window.
        Source: Hairer, Wanner, Solving ODEs II, IV.8, Eq. (8.19).
        """
        n, g = path.w.shape[-1], self.grid.h[:, None, None] / (self.grid.stages + 1)
        w = np.concatenate([before[None], path.w[:-1, -1]])
        a = (w - np.einsum("j,kjn->kn", self._to_start, path.w))[..., None]
        v = (path.x[:-1, n:] - np.einsum("j,kjn->kn", self._to_start, path.v))[..., None]
        M, D, K = self.M[:, 0], self.D[:, 0], self.K[:, 0]
        rates = np.linalg.solve(M + g * D + g * g * K, g * (M @ a - g * (K @ v)))
        return np.concatenate([g * (rates + v), rates], axis=1)[..., 0]

    @lazy
    def _to_start(self) -> Array:
        """The stages' Lagrange polynomials at the beginning of the step, (s,)."""
        c = self.grid.rule.c
        apart = c[:, None] - c + np.eye(len(c))
        return np.prod(np.where(np.eye(len(c), dtype=bool), 1.0, -c / apart), axis=1)


def stage_matrix(M: Array, hD: Array, hhK: Array, rule: Tableau) -> Array:
    """The matrices (K, s n, s n) of the stages' accelerations: M_i on the diagonal, a_ij h D_i + (a^2)_ij h^2 K_i everywhere."""
    count, s, n = M.shape[:3]
    G = np.empty((count, s, n, s, n))
    np.multiply(rule.a[:, None, :, None], hD[:, :, :, None, :], out=G)
    G += (rule.a @ rule.a)[:, None, :, None] * hhK[:, :, :, None, :]
    stage = np.arange(s)
    G[:, stage, :, stage, :] += np.moveaxis(M, 1, 0)
    return G.reshape(count, s * n, s * n)


def between(grid: Grid, path: Path, power: Array, t: Array) -> tuple[Array, Array]:
    """States (N, 2n) at times t of a grid, and the work (N,) done since its beginning, by the collocation polynomials.

    power: (K, s), the rate of the work at the stages.
    """
    rule, n, j = grid.rule, path.w.shape[-1], np.arange(grid.stages)
    k = np.clip(np.searchsorted(grid.edges, t) - 1, 0, grid.count - 1)
    h = grid.h[k, None]
    u = (t - grid.edges[k])[:, None] / h
    powers = np.linalg.inv(np.vander(rule.c, grid.stages, increasing=True))
    once, twice = (u ** (j + 1) / (j + 1)) @ powers, (u ** (j + 2) / ((j + 1) * (j + 2))) @ powers
    y, v, w = path.x[k, :n], path.x[k, n:], path.w[k]
    rate = v + h * np.einsum("ts,tsn->tn", once, w)
    place = y + h * u * v + h * h * np.einsum("ts,tsn->tn", twice, w)
    done = np.append(0.0, np.cumsum(grid.h * (power @ rule.b)))[k] + h[:, 0] * np.einsum("ts,ts->t", once, power[k])
    return np.concatenate([place, rate], axis=1), done
