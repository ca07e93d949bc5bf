"""Linear-quadratic problems in scattering form: segments that combine by the Redheffer star product and never overflow."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from flexlin.checks import Array
from flexlin.errors import IllPosedSegment
from flexlin.periodic.precision import TINY

MAX_DOUBLINGS = 64
"""Of a period: a loop that hardly forgets takes 2^64 of them."""
REACH = 2.0
"""Size of a matrix whose exponential takes no squaring."""


@dataclass(frozen=True)
class Segment:
    """One stretch of a linear-quadratic problem (or a stack of them: leading axes).

        x1 = F x0 - G l1,   l0 = H x0 + F' l1

    F carries the state forward, H is the cost of x0 when the end is free, G what control (or noise) does to the end state.
    """

    F: Array
    G: Array
    H: Array

    def __getitem__(self, index: slice | int) -> "Segment":
        return Segment(self.F[index], self.G[index], self.H[index])

    def __len__(self) -> int:
        return len(self.F)


def scatter_hamiltonian(transition: Array) -> Segment:
    """Turn the transition matrix of a Hamiltonian system into scattering form.

        [x1; l1] = [[P11, P12], [P21, P22]] [x0; l0]:   F' = P22^-1,   H = -P22^-1 P21,   G = -P12 P22^-1

    Assumes a symplectic transition matrix (Gauss collocation gives one): then the map of x0 to x1 is F as well.

    Parameters: transition (..., 2n, 2n).
    Returns: a segment of shape (..., n, n), G and H exactly symmetric.
    Raises: IllPosedSegment when P22 is singular: the segment is too long for its coefficients.
    Source: Redheffer (1960).
    """
    n = transition.shape[-1] // 2
    P12, P21, P22 = transition[..., :n, n:], transition[..., n:, :n], transition[..., n:, n:]
    solved = solve_segments(P22, np.concatenate([np.broadcast_to(np.eye(n), P22.shape), P21], axis=-1), "P22")
    inverse, H = solved[..., :n], -solved[..., n:]
    return Segment(transpose(inverse), symmetrize(-P12 @ inverse), symmetrize(H))


def star_product(first: Segment, second: Segment) -> Segment:
    """Combine two neighbouring segments of a linear-quadratic problem into one.

    A segment maps (x0, l1) to (x1, l0):   x1 = F x0 - G l1,   l0 = H x0 + F' l1.
    Eliminating the state and costate between the two gives, with W = (I + G1 H2)^-1,

        F = F2 W F1,   G = G2 + F2 W G1 F2',   H = H1 + F1' H2 W F1.

    Assumes G, H symmetric positive semidefinite: then I + G1 H2 is invertible.

    Parameters: segments with F, G, H of shape (..., n, n); leading axes broadcast.
    Returns: a segment of the same shape; G and H exactly symmetric.
    Raises: IllPosedSegment, naming the segment, when I + G1 H2 is singular to working precision.
    Source: Redheffer (1960); doubling as in Anderson (1978).
    """
    n = first.F.shape[-1]
    W = solve_segments(np.eye(n) + first.G @ second.H, np.concatenate([first.F, first.G], axis=-1), "I + G1 H2")
    forward, spread = W[..., :n], W[..., n:]
    return Segment(
        second.F @ forward,
        second.G + symmetrize(second.F @ spread @ transpose(second.F)),
        first.H + symmetrize(transpose(first.F) @ second.H @ forward),
    )


def carry_cost_back(segment: Segment, after: Array) -> Array:
    """Carry a quadratic cost x' X x from the end of a segment to its start.

        X0 = H + F' X1 (I + G X1)^-1 F

    Parameters: segment (..., n, n); after: X1, (..., n, n), symmetric positive semidefinite.
    Returns: X0, exactly symmetric.
    Raises: IllPosedSegment when I + G X1 is singular.
    """
    n = segment.F.shape[-1]
    forward = solve_segments(np.eye(n) + segment.G @ after, segment.F, "I + G X")
    return segment.H + symmetrize(transpose(segment.F) @ after @ forward)


def combine_in_tree(segments: Segment) -> list[Segment]:
    """Combine neighbours pairwise, level by level: the first entry is the segments, the last has length 1, the whole.

    An odd last segment moves up a level as it is. Every level is one batched star product.
    """
    levels = [segments]
    while len(levels[-1]) > 1:
        level = levels[-1]
        pairs = len(level) // 2 * 2
        both, rest = star_product(level[0:pairs:2], level[1:pairs:2]), level[pairs:]
        levels.append(Segment(*map(np.concatenate, ((both.F, rest.F), (both.G, rest.G), (both.H, rest.H)))))
    return levels


def carry_costs_down(levels: list[Segment], end: Array) -> Array:
    """Carry the cost at the end of the whole back to every segment's start, down the tree of products.

    Parameters: levels of K segments from `combine_in_tree`; end (n, n): the cost behind the last segment.
    Returns: (K + 1, n, n): X at all edges, the last one `end`.
    """
    after = end[None]
    for level in reversed(levels[:-1]):
        pairs = len(level) // 2 * 2
        below = np.empty((len(level), *end.shape))
        below[1::2] = after[: pairs // 2]
        below[0:pairs:2] = carry_cost_back(level[1:pairs:2], after[: pairs // 2])
        if pairs != len(level):
            below[-1] = after[-1]
        after = below
    return np.concatenate([carry_cost_back(levels[0], after), end[None]])


def symmetrize(matrix: Array) -> Array:
    """Return the symmetric part."""
    return 0.5 * (matrix + transpose(matrix))


def transpose(matrix: Array) -> Array:
    """Transpose the last two axes."""
    return np.swapaxes(matrix, -1, -2)


def solve_segments(matrix: Array, right: Array, name: str) -> Array:
    """Solve a stack of linear systems, naming the segment whose matrix is singular."""
    try:
        solution = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        solution = np.full(right.shape, np.nan)
    if not np.all(np.isfinite(solution)):
        flat = np.nan_to_num(matrix.reshape(-1, *matrix.shape[-2:]), nan=0.0, posinf=0.0, neginf=0.0)
        worst = int(np.argmin([np.linalg.svd(m, compute_uv=False)[-1] for m in flat]))
        raise IllPosedSegment(
            f"{name} of segment {worst} of {len(flat)} is singular to working precision",
            todo="use shorter segments (a smaller tol), or check that Q >= 0 and R > 0",
        )
    return solution


def scatter_exponentials(averages: Array) -> Segment:
    """Exponentiate Hamiltonian matrices (K, 2 n, 2 n) in scattering form: SciPy's diagonal Pade approximations are symplectic."""
    square = averages @ averages
    size = np.linalg.norm(square @ square, 1, axis=(1, 2)).max() ** 0.25
    doublings = int(max(0, np.ceil(np.log2(max(size, TINY) / REACH))))
    segments = scatter_hamiltonian(expm(averages / 2**doublings))
    for _ in range(doublings):
        segments = star_product(segments, segments)
    return segments
