"""Periodic vectors of known exponents along a product of transition matrices, by null vectors of cyclic systems."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.precision import CUBE, FARTHEST
from flexlin.periodic.product.cyclic import cyclic_system


def periodic_vectors(
    factors: Array, times: Array, exponents: Array, ranks: Array, together: int
) -> tuple[Array, Array]:
    """p_k (K, n, m) with p_(k+1) = exp(-lambda_i h_k) F_k p_k, p_K = p_0, for factors (K, n, n) between times (K + 1,).

    So many factors as stand `together` are multiplied before the cyclic system is solved, and give what lies inside afterwards:
    over them no two modes may part by more than a few digits, and where one would overflow they are taken one by one.
    Returns: p, and whether the factors know such vectors (m,): not where a mode is too fast for them.
    """
    longest = float(np.diff(np.append(times[:-1:together], times[-1])).max())
    if together > 1 and not np.abs(exponents.real).max() * longest < FARTHEST:
        together = 1
    within, marks = multiply_within(factors, together), np.append(times[:-1:together], times[-1])
    loss = np.clip(-exponents.real[:, None] * np.diff(marks), -FARTHEST, FARTHEST)
    decay = np.exp(loss - 1j * exponents.imag[:, None] * np.diff(marks))
    at_marks, known = find_null_modes(decay[..., None, None] * within[:, -1], ranks)
    inside = np.concatenate([at_marks[:, None], within[:, :-1] @ at_marks[:, None]], axis=1)
    since = times[:-1] - np.repeat(marks[:-1], together)[: len(factors)]
    vectors = inside.reshape(-1, *at_marks.shape[1:])[: len(factors)] * np.exp(-since[:, None] * exponents)[:, None]
    return vectors, known & (np.abs(loss) < FARTHEST).all(axis=1)


def multiply_within(factors: Array, together: int) -> Array:
    """F_j ... F_0 inside each group of so many factors (G, together, n, n); the last group is filled up by identities."""
    n = factors.shape[-1]
    rest = np.broadcast_to(np.eye(n), (-len(factors) % together, n, n))
    products = np.concatenate([factors, rest]).reshape(-1, together, n, n)
    for j in range(1, together):
        products[:, j] = products[:, j] @ products[:, j - 1]
    return products


def find_null_modes(G: Array, ranks: Array) -> tuple[Array, Array]:
    """Null vectors (K, n, m) of the cyclic systems of G (m, K, n, n), members of a cluster take different ones; and which exist (m,)."""
    system = cyclic_system(G)
    x, sigma = system.null_vectors(int(ranks.max()) + 1)
    modes = [x[i, :, :, rank if sigma[i, rank] < CUBE * system.size[i] else 0] for i, rank in enumerate(ranks)]
    return np.stack(modes, axis=-1), sigma[:, 0] < CUBE * system.size
