"""The cheapest one-to-one assignment of rows to columns."""

import numpy as np

from flexlin.checks import Array


def assign(cost: Array) -> Array:
    """The column of each row (n,) such that the sum of the costs (n, m), n <= m, is least.

    Each row takes its cheapest column; those that come too late for it push others aside by shortest augmenting paths. Written out, since
    `scipy.optimize` takes longer to load than most spectra to compute; it serves costs that are not finite.
    Source: Jonker and Volgenant, A shortest augmenting path algorithm for linear assignment problems, Computing 38 (1987).
    """
    if not np.isfinite(cost).all():
        from scipy.optimize import linear_sum_assignment

        return np.asarray(linear_sum_assignment(cost)[1])
    cheapest = cost.argmin(axis=1)
    column = np.full(len(cost), -1)
    taken, first = np.unique(cheapest, return_index=True)
    column[first] = taken
    if len(taken) == len(cost):
        return column
    row = np.full(cost.shape[1], -1)
    row[taken] = first
    u, v = cost.min(axis=1), np.zeros(cost.shape[1])
    for free in np.flatnonzero(column < 0):
        augment(int(free), cost, u, v, row, column)
    return column


def augment(free: int, cost: Array, u: Array, v: Array, row: Array, column: Array) -> None:
    """Give a free row a column by the cheapest chain of exchanges, in place: Dijkstra's algorithm on cost - u - v >= 0.

    Parameters: u (n,), v (m,): dual prices, for which the assigned entries of cost - u - v are zero; row (m,), column (n,): who has whom.
    """
    length, before, visited = np.full(len(v), np.inf), np.full(len(v), free), np.zeros(len(v), dtype=bool)
    current, reached = free, 0.0
    while True:
        onward = reached + cost[current] - u[current] - v
        shorter = ~visited & (onward < length)
        length[shorter], before[shorter] = onward[shorter], current
        nearest = int(np.where(visited, np.inf, length).argmin())
        reached = float(length[nearest])
        if row[nearest] < 0:
            break
        visited[nearest], current = True, int(row[nearest])
    u[free] += reached
    u[row[visited]] += reached - length[visited]
    v[visited] -= reached - length[visited]
    while True:
        current = int(before[nearest])
        row[nearest], column[current], nearest = current, nearest, int(column[current])
        if current == free:
            return
