"""The cyclic two-point system of a period, condensed by orthogonal transformations; periodic vectors of known exponents from it."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.precision import CUBE, FARTHEST


@dataclass(frozen=True)
class Halving:
    """One halving: R x_mid = top - left x_left - right x_right, and the rows Q that make it."""

    Q: Array
    R: Array
    left: Array
    right: Array
    odd: bool


@dataclass(frozen=True)
class CyclicSystem:
    """The condensed form of x_(k+1) - F_k x_k = g_k, x_K = x_0.

    Neighbouring rows C1 x_0 + D1 x_1 = g1, C2 x_1 + D2 x_2 = g2 are rotated by the full QR of [D1; C2]:
    the upper half gives x_1 from its neighbours, the lower half is one row between x_0 and x_2. Halving repeats until
    (C + D) x_0 = g. No product of factors is ever formed.

    Source: Wright, Stable parallel algorithms for two-point boundary value problems, SIAM J. Sci. Stat. Comput. 13 (1992).
    """

    levels: tuple[Halving, ...]
    closure: Array
    size: Array
    """Of C and D before they are added (...): what a singular value of their sum counts against."""

    def solve(self, g: Array) -> Array:
        """Return x_0 ... x_(K-1) of shape (..., K, n, r) for right sides g of the same shape."""
        tops = []
        for level in self.levels:
            top, g = condense_right(level, g)
            tops.append(top)
        return self.expand(solve_batch(self.closure, g[..., 0, :, :]), tops)

    def expand(self, x: Array, tops: list[Array] | None = None) -> Array:
        """Return all x_k (..., K, n, r) from x_0 (..., n, r); without tops for zero right sides."""
        x = x[..., None, :, :]
        for i in range(len(self.levels) - 1, -1, -1):
            level = self.levels[i]
            pairs = level.R.shape[-3]
            left, right = x[..., :pairs, :, :], np.roll(x, -1, axis=-3)[..., :pairs, :, :]
            inner = -(level.left @ left + level.right @ right)
            if tops is not None:
                inner = inner + tops[i]
            middle = solve_batch(level.R, inner)
            both = np.stack([left, middle], axis=-3).reshape(*middle.shape[:-3], 2 * pairs, *middle.shape[-2:])
            x = np.concatenate([both, x[..., pairs:, :, :]], axis=-3) if level.odd else both
        return x

    def null_vectors(self, count: int) -> tuple[Array, Array]:
        """Return x_k (..., K, n, count) of nearly zero residual, and the singular values of the closure, smallest first.

        Scaling: x_0 has orthonormal columns; the other x_k follow.
        """
        _, sigma, Vh = np.linalg.svd(self.closure)
        x0 = np.conj(np.swapaxes(Vh[..., ::-1, :][..., :count, :], -1, -2))
        return self.expand(x0), sigma[..., ::-1]


def solve_batch(R: Array, right: Array) -> Array:
    """Solve a batch of small systems, naming what a singular one means."""
    try:
        return np.linalg.solve(R, right)
    except np.linalg.LinAlgError:
        raise ToleranceNotReached(
            "the periodic two-point system is singular to working precision",
            todo="use more segments or scale the states",
        ) from None


def cyclic_system(F: Array) -> CyclicSystem:
    """Condense x_(k+1) - F_k x_k = g_k, x_K = x_0 for factors F (..., K, n, n), real or complex."""
    C, D = -F, np.broadcast_to(np.eye(F.shape[-1], dtype=F.dtype), F.shape)
    levels = []
    while C.shape[-3] > 1:
        level, C, D = halve_rows(C, D)
        levels.append(level)
    C, D = C[..., 0, :, :], D[..., 0, :, :]
    return CyclicSystem(tuple(levels), C + D, np.linalg.norm(C, axis=(-2, -1)) + np.linalg.norm(D, axis=(-2, -1)))


def halve_rows(C: Array, D: Array) -> tuple[Halving, Array, Array]:
    """Eliminate every second unknown from the rows C_k x_k + D_k x_(k+1)."""
    count, n = C.shape[-3:-1]
    even, odd = slice(0, count - count % 2, 2), slice(1, None, 2)
    Q, R = np.linalg.qr(np.concatenate([D[..., even, :, :], C[..., odd, :, :]], axis=-2), mode="complete")
    Qh = np.conj(np.swapaxes(Q, -1, -2))
    left, right = Qh[..., :n] @ C[..., even, :, :], Qh[..., n:] @ D[..., odd, :, :]
    level = Halving(Qh, R[..., :n, :], left[..., :n, :], right[..., :n, :], count % 2 == 1)
    C_next, D_next = left[..., n:, :], right[..., n:, :]
    if level.odd:
        C_next = np.concatenate([C_next, C[..., -1:, :, :]], axis=-3)
        D_next = np.concatenate([D_next, D[..., -1:, :, :]], axis=-3)
    return level, C_next, D_next


def condense_right(level: Halving, g: Array) -> tuple[Array, Array]:
    """Rotate the right sides of one level: those of the eliminated rows, and of the rows that remain."""
    n, last = g.shape[-2], g.shape[-3] - level.odd
    rotated = level.Q @ np.concatenate([g[..., 0:last:2, :, :], g[..., 1:last:2, :, :]], axis=-2)
    rest = rotated[..., n:, :]
    return rotated[..., :n, :], np.concatenate([rest, g[..., last:, :, :]], axis=-3) if level.odd else rest


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
