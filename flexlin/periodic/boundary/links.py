"""Which point of the boundary follows which: through each cell of a lattice, with the unstable side on the left."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexlin.checks import Array
from flexlin.periodic.boundary.lattice import Nodes

SHORT = 0.1
"""Weight of a link's length, in cells, against its turning."""


def find_cells(nodes: Nodes, shape: tuple[int, int]) -> tuple[Array, Array]:
    """The cell (V, 2) that the boundary enters at each node, and the one that it leaves; -1 outside the lattice.

    With the unstable side on the left, a crossing of a line along x whose unstable side is at larger x runs towards smaller y,
    one of a line along y whose unstable side is at larger y towards larger x.
    """
    along = nodes.axis == 0
    ahead = np.stack([np.where(along, nodes.cell, nodes.line), np.where(along, nodes.line, nodes.cell)], axis=1)
    behind = ahead - np.stack([~along, along], axis=1).astype(int)
    forward = (along != nodes.rising)[:, None]
    inside = np.array(shape) - 1
    cells = [np.where(forward, ahead, behind), np.where(forward, behind, ahead)]
    entered, left = (np.where(np.all((cell >= 0) & (cell < inside), axis=1)[:, None], cell, -1) for cell in cells)
    return entered, left


def link_nodes(nodes: Nodes, directions: Array, shape: tuple[int, int]) -> Array:
    """The node that follows each one (V,), -1 where the boundary leaves the range.

    Where several pieces of the boundary pass through one cell, those links are taken that turn least.
    Parameters: directions (V, 2): unit tangents, unstable side on the left; shape: lattice lines along x and y.
    """
    entered, left = find_cells(nodes, shape)
    follower = np.full(len(nodes), -1)
    keys_in, keys_out = entered @ [shape[1] + 1, 1], left @ [shape[1] + 1, 1]
    for key in np.unique(keys_in[entered[:, 0] >= 0]):
        coming, going = (
            np.flatnonzero((keys_in == key) & (entered[:, 0] >= 0)),
            np.flatnonzero((keys_out == key) & (left[:, 0] >= 0)),
        )
        rows, columns = linear_sum_assignment(measure_turning(nodes.points, directions, coming, going, shape))
        follower[coming[rows]] = going[columns]
    return follower


def measure_turning(points: Array, directions: Array, coming: Array, going: Array, shape: tuple[int, int]) -> Array:
    """How much a link from each of some nodes to each of others turns, plus a little for its length."""
    chord = points[going][None] - points[coming][:, None]
    length = np.linalg.norm(chord, axis=2)
    unit = chord / np.maximum(length, 1e-300)[..., None]
    ahead = np.einsum("ik,ijk->ij", directions[coming], unit)
    after = np.einsum("jk,ijk->ij", directions[going], unit)
    return 2.0 - ahead - after + SHORT * length * max(shape)


def list_chains(follower: Array) -> list[tuple[Array, bool]]:
    """The curves as vertices in order, and whether each is closed; a closed one ends where it begins."""
    first = np.setdiff1d(np.arange(len(follower)), follower)
    seen = np.zeros(len(follower), dtype=bool)
    chains = []
    for start in (*first, *range(len(follower))):
        chain, node = list[int](), int(start)
        while node >= 0 and not seen[node]:
            seen[node] = True
            chain.append(node)
            node = int(follower[node])
        if chain:
            closed = node == chain[0]
            chains.append((np.array([*chain, node] if closed else chain), closed))
    return [(chain, closed) for chain, closed in chains if len(chain) > 1]
