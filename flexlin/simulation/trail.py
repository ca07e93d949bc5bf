"""What a run leaves to the next one on the same motion: how long its steps should have been, and where it went."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.simulation.mesh import Mesh, join_edges
from flexlin.simulation.window import Grid, Path, Rule


@dataclass(frozen=True)
class Trail:
    """The mesh of a run, for its tol; the edges (K + 1,) of its steps and the accelerations (K, s, n) at their stages."""

    mesh: Mesh
    tol: float
    edges: Array
    w: Array

    @classmethod
    def of(cls, meshes: list[Mesh], windows: list[tuple[Array, Array]], tol: float) -> "Trail":
        """That of windows that follow each other."""
        edges, w = zip(*windows, strict=True)
        return cls(Mesh.joined(meshes), tol, join_edges(edges), np.concatenate(w))

    def mesh_for(self, tol: float, stages: int) -> Mesh:
        """The mesh for a run with another tol and as many stages."""
        return Mesh(self.mesh.edges, self.mesh.lengths * (tol / self.tol) ** (1 / (stages + 1)))

    def follow(self, grid: Grid, start: Array) -> Path:
        """The motion from a state (2n,) with these accelerations, by the polynomials through the stages."""
        stages, n = self.w.shape[1:]
        which = np.clip(np.searchsorted(self.edges, grid.times) - 1, 0, len(self.w) - 1)
        begin = self.edges[which]
        inside = (grid.times - begin) / (self.edges[which + 1] - begin)
        shares = inside[..., None] ** np.arange(stages) @ Rule.of(stages).powers
        w = (shares[..., None, :] @ self.w[which])[..., 0, :]
        h, rule = grid.h[:, None], grid.rule.tableau
        x = np.empty((grid.count + 1, 2 * n))
        x[:, n:] = start[n:] + np.append(np.zeros((1, n)), np.cumsum(h * (rule.b @ w), axis=0), axis=0)
        moved = h * x[:-1, n:] + h**2 * ((rule.b * (1 - rule.c)) @ w)
        x[:, :n] = start[:n] + np.append(np.zeros((1, n)), np.cumsum(moved, axis=0), axis=0)
        return grid.path(x, w)
