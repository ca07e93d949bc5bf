"""Segments that combine in trees and never overflow: linear-quadratic problems in scattering form, and a loop's Lyapunov equation.

Segments of a linear-quadratic problem are stacks (3, ..., n, n) of F, G, H:

    x1 = F x0 - G l1,   l0 = H x0 + F' l1

F carries the state forward, H is the cost of x0 when the end is free, G what control (or noise) does to the end state.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.linalg import expm, lapack

from flexlin.checks import Array
from flexlin.errors import IllPosedSegment, NumericalError
from flexlin.periodic.coefficients import Constant, MatrixFunction, assemble_hamiltonian
from flexlin.periodic.riccati.nodes import Nodes
from flexlin.periodic.transition.factors import gauss_transitions
from flexlin.precision import EPS, ROOT_EPS, TINY

MAX_DOUBLINGS = 64
"""Of a period: a loop that hardly forgets takes 2^64 of them."""
POWER_REACH = 0.25
"""Size of a step times the loop from which on a few powers give its exponential."""
SLOW_DOUBLINGS = 3
"""Doublings of a half step up to which no mode oscillates in it."""


def scatter_hamiltonian(transition: Array) -> Array:
    """Turn the transition matrix of a Hamiltonian system into scattering form.

        [x1; l1] = [[P11, P12], [P21, P22]] [x0; l0]:   F' = P22^-1,   H = -P22^-1 P21,   G = -P12 P22^-1

    Assumes a symplectic transition matrix (Gauss collocation gives one): then the map of x0 to x1 is F as well.

    Parameters: transition (..., 2n, 2n).
    Returns: segments (3, ..., n, n), G and H exactly symmetric.
    Raises: IllPosedSegment when P22 is singular: the segment is too long for its coefficients.
    Source: Redheffer (1960).
    """
    n = transition.shape[-1] // 2
    P12, P21, P22 = transition[..., :n, n:], transition[..., n:, :n], transition[..., n:, n:]
    solved = solve_segments(P22, np.concatenate([np.broadcast_to(np.eye(n), P22.shape), P21], axis=-1), "P22")
    inverse, H = solved[..., :n], -solved[..., n:]
    return np.stack([transpose(inverse), symmetrize(-P12 @ inverse), symmetrize(H)])


def star_product(first: Array, second: Array) -> Array:
    """Combine two neighbouring segments of a linear-quadratic problem into one.

    A segment maps (x0, l1) to (x1, l0):   x1 = F x0 - G l1,   l0 = H x0 + F' l1.
    Eliminating the state and costate between the two gives, with W = (I + G1 H2)^-1,

        F = F2 W F1,   G = G2 + F2 W G1 F2',   H = H1 + F1' H2 W F1.

    Assumes G, H symmetric positive semidefinite: then I + G1 H2 is invertible.

    Parameters: segments (3, ..., n, n).
    Returns: segments of the same shape; G and H exactly symmetric.
    Raises: IllPosedSegment, naming the segment, when I + G1 H2 is singular to working precision.
    Source: Redheffer (1960); doubling as in Anderson (1978).
    """
    (F1, G1, H1), (F2, G2, H2), both = first, second, np.empty_like(first)
    n = F1.shape[-1]
    with np.errstate(over="ignore", invalid="ignore"):  # what leaves the range of numbers is refused later
        W = solve_segments(np.eye(n) + G1 @ H2, np.concatenate([F1, G1], axis=-1), "I + G1 H2")
        forward, spread = W[..., :n], W[..., n:]
        both[0], both[1] = F2 @ forward, G2 + symmetrize(F2 @ spread @ transpose(F2))
        both[2] = H1 + symmetrize(transpose(F1) @ H2 @ forward)
    return both


def carry_cost_back(segment: Array, after: Array) -> Array:
    """Carry a quadratic cost x' X x from the end of a segment to its start.

        X0 = H + F' X1 (I + G X1)^-1 F

    Parameters: segment (3, ..., n, n); after: X1, (..., n, n), symmetric positive semidefinite.
    Returns: X0, exactly symmetric.
    Raises: IllPosedSegment when I + G X1 is singular.
    """
    F, G, H = segment
    return np.asarray(
        H + symmetrize(transpose(F) @ after @ solve_segments(np.eye(F.shape[-1]) + G @ after, F, "I + G X"))
    )


def pair_up(level: Array, join: Callable[[Array, Array], Array]) -> Array:
    """Neighbours (..., K, n, n) joined two by two; an odd last one stays as it is."""
    both = join(level[..., :-1:2, :, :], level[..., 1::2, :, :])
    return np.concatenate([both, level[..., 2 * both.shape[-3] :, :, :]], axis=-3)


def grow_tree(level: Array, join: Callable[[Array, Array], Array]) -> list[Array]:
    """Neighbours joined level by level: the first entry is what is given, the last has length 1, the whole."""
    levels = [level]
    while levels[-1].shape[-3] > 1:
        levels.append(pair_up(levels[-1], join))
    return levels


def spread_pairs(behind: Array, count: int, carry: Callable[[Array], Array]) -> Array:
    """What is behind each of `count` segments (K, n, n), from what is behind their pairs; carry: to before the second ones."""
    pairs, below = count // 2, np.empty((count, *behind.shape[1:]))
    below[1::2], below[2 * pairs :] = behind[:pairs], behind[pairs:]
    below[:-1:2] = carry(below[1::2])
    return below


def carry_costs_down(levels: list[Array], end: Array) -> Array:
    """Carry the cost at the end of the whole back to every segment's start, down the tree of products.

    Parameters: levels of K segments by star products; end (n, n): the cost behind the last segment.
    Returns: (K + 1, n, n): X at all edges, the last one `end`.
    """
    behind = end[None]
    for level in reversed(levels[:-1]):
        behind = spread_pairs(behind, level.shape[1], partial(carry_cost_back, level[:, 1::2]))
    return np.concatenate([carry_cost_back(levels[0], behind), end[None]])


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


def scatter_exponentials(averages: Array) -> Array:
    """Exponentiate Hamiltonian matrices (K, 2 n, 2 n) in scattering form: SciPy's diagonal Pade approximations are symplectic."""
    square = averages @ averages
    size = np.linalg.norm(square @ square, 1, axis=(1, 2)).max() ** 0.25
    doublings = int(max(0, np.ceil(np.log2(max(size, TINY) / 2))))  # up to a size of 2 it takes no squaring
    segments = scatter_hamiltonian(expm(averages / 2**doublings))
    for _ in range(doublings):
        segments = star_product(segments, segments)
    return segments


class LoopLyapunov:
    """-D' = M' D + D M + F at nodes, M and F held constant half-way to each neighbour, D repeating or zero at the end.

        D(t) = e' D(t + s) e + integral of exp(M' r) F exp(M r) dr over s,   e = exp(M s)

    Both are doubled from s / 2^k on, where a few powers of M do. Gaps between nodes, two half steps each, are combined pairwise in a tree.
    What is missed is of second order in the steps, of the loop's change rather than of its size. Where the transition matrices Phi of
    the gaps h are known, it is of fourth order by Hermite's rule:

        D(t) = Phi' D(t + h) Phi + h/2 (F + Phi' F+ Phi) + h^2/12 (G - Phi' G+ Phi),   G = F' + M' F + F M,  + at the next node

    Source: Hochbruck, Ostermann, Exponential integrators, Acta Numerica 19 (2010) 209; for whole periods: Smith, SIAM J. Appl. Math. 16
    (1968) 198.

    Parameters: M (N, n, n) at the nodes; exact (2 N, n, n): the transition matrices of the half steps before all nodes and behind them,
    where they are known better: a mode that hardly decays needs them.
    """

    def __init__(self, M: Array, nodes: Nodes, exact: Array | None = None):
        self.M, self.nodes, self.exact = M, nodes, exact is not None
        self.halves = nodes.halves[:, :, None, None]
        steps = self._find_powers() if exact is None else exact
        self.first, last = self._divide(steps, steps)
        whole = last @ self.first
        if not nodes.wraps:
            whole[-1] = 0.0
        self.levels = grow_tree(whole, lambda first, second: second @ first)
        self.squares = list_squares(self.levels[-1])

    def _find_powers(self) -> Array:
        """The exponentials of the half steps, from those of the shares of them that a few powers of M give."""
        steps = (self.halves * self.M).reshape(-1, *self.M.shape[1:])
        square = steps @ steps
        size = float(np.linalg.norm(square @ square, 1, axis=(-2, -1)).max()) ** 0.25
        self.share = 0.5 ** max(0.0, np.ceil(np.log2(max(size, POWER_REACH) / POWER_REACH)))
        self.steps = self.share * steps
        square *= self.share**2
        power = self.steps + 0.5 * square + square @ (self.steps / 6 + square / 24) + np.eye(self.M.shape[-1])
        self.powers = [power]
        while 0.5 ** (len(self.powers) - 1) > self.share:
            self.powers.append(self.powers[-1] @ self.powers[-1])
        return self.powers[-1]

    def solve(self, F: Array) -> Array | None:
        """D (N, n, n) of a symmetric right side; None where the loop does not forget.

        Modes that oscillate many times in a step would ring where M and F jump half-way between nodes; so beside these, in a second
        solution, F takes its slope and what the loop's change makes of the first one.
        """
        if self.exact:
            return self._carry_back(self._integrate_gaps(F))
        constant = self._integrate(F)
        D = self._carry_back(self._join(constant, constant))
        if D is None or len(self.powers) <= SLOW_DOUBLINGS:
            return D
        line, whole = self._integrate_line(self.nodes.slopes(F) + twice(D @ self.nodes.slopes(self.M)))
        return self._carry_back(self._join(constant + line, constant + line - whole))

    def integrate_behind(self, F: Array) -> Array:
        """What F makes of D in the half step behind each node."""
        return self.halves[-1] * F if self.exact else self._integrate(F)[-len(F) :]

    def _integrate_gaps(self, F: Array) -> Array:
        """The integrals over the gaps by Hermite's rule."""
        behind, before = self._divide(self.halves[-1], self.halves[0])
        h, Phi = behind + before, self.levels[0]
        G = h / 6 * (self.nodes.slopes(F) + twice(F @ self.M))
        ahead = np.roll(F, -1, axis=0) - np.roll(G, -1, axis=0)
        return h / 2 * (F + G + transpose(Phi) @ ahead @ Phi)

    def _join(self, behind: Array, before: Array) -> Array:
        return carry_back(self.first, *self._divide(behind, before))

    def _carry_back(self, part: Array) -> Array | None:
        parts = [part]
        for Phi in self.levels[:-1]:
            parts.append(pair_up(parts[-1], partial(carry_back, Phi[:-1:2])))
        behind = parts[-1]
        for square in self.squares:
            behind = carry_back(square, behind, behind)
        if not (self.squares and np.isfinite(behind).all()):
            return None
        for Phi, part in zip(self.levels[-2::-1], parts[-2::-1], strict=True):
            behind = spread_pairs(behind, len(part), partial(carry_back, Phi[1::2], part[1::2]))
        return symmetrize(np.roll(behind, 1, axis=0))  # behind a gap is at the next node

    def _integrate(self, F: Array) -> Array:
        """The integral of exp(M' r) F exp(M r) over each half step."""
        total = self.share * (self.halves * F).reshape(-1, *F.shape[1:])
        once = twice(total @ self.steps)
        total += 0.5 * once + twice(once @ self.steps) / 6
        for power in self.powers[:-1]:
            total += transpose(power) @ total @ power
        return total

    def _integrate_line(self, slope: Array) -> tuple[Array, Array]:
        """The integrals over each half step s of exp(M' r) r F' exp(M r), and of the same with s in place of r."""
        change = self.share * (self.halves * slope).reshape(-1, *slope.shape[1:])
        step = self.share * self.halves.reshape(-1, *self.halves.shape[2:])
        once = twice(change @ self.steps)
        again = twice(once @ self.steps)
        total, whole = step * (change / 2 + once / 3 + again / 8), step * (change + once / 2 + again / 6)
        for power in self.powers[:-1]:
            total, whole = carry_back(power, total, total + whole), 2 * carry_back(power, whole, whole)
        return total, whole

    def _divide(self, behind: Array, before: Array) -> tuple[Array, Array]:
        """What belongs to the half steps behind each node, and to those before the next one."""
        N = len(self.M)
        return behind[-N:], np.roll(before[:N], -1, axis=0)


def step_exactly(A: MatrixFunction, nodes: Nodes, units: Array) -> Array | None:
    """The transition matrices of x' = A x over the half steps before all nodes and behind them (2 N, n, n), in units of the states.

    None where A is constant, whose exponentials are exact, or where its fastest mode turns or decays by 1 in a half step: up to there
    Gauss stages are exact, and corrections by Hermite's rule converge.
    """
    if isinstance(A, Constant):
        return None
    halves = np.broadcast_to(nodes.halves, (2, nodes.count))
    edges = np.concatenate([[-halves[0, 0]], np.cumsum(halves.T) - halves[0, 0]])
    fourth = np.linalg.matrix_power(halves.max() * A(nodes.t), 4)  # as fast as the modes, whatever the units
    if not np.abs(fourth).sum(axis=2).max() < 1:
        return None
    steps = gauss_transitions(lambda t: A(np.mod(t, nodes.period)), edges) * (units[:, None] / units)
    return np.concatenate([steps[0::2], steps[1::2]])


def balance_states(F: Array, G: Array, H: Array) -> Array:
    """Units (n,), powers of two, in which rows and columns of a linear-quadratic problem (N, n, n each) are of like sizes.

    Source: Benner, Symplectic balancing of Hamiltonian matrices, SIAM J. Sci. Comput. 22 (2001) 1885.
    """
    sizes = np.abs(assemble_hamiltonian(F, G, H)).max(axis=0)
    np.fill_diagonal(sizes, 0.0)  # units leave it as it is
    states, costates = np.split(np.log2(lapack.dgebal(sizes, scale=1, permute=0)[3]), 2)
    return np.asarray(2.0 ** np.round((costates - states) / 2))


def double_until_rest(
    whole: Array, limits: tuple[float, float], refuse: Callable[[bool, Array], NumericalError]
) -> tuple[Array, int]:
    """Double one segment (3, n, n) until the cost H of 2^k of them stops changing and their memory F is gone: H and k.

    limits: of H and G, from which on they are held to grow for ever.
    Raises: refuse(True, whole) where H grows, refuse(False, whole) where G does or F does not decay.
    """
    scale = max(float(np.abs(whole[0]).max()), 1.0)
    for k in range(MAX_DOUBLINGS):
        try:
            twice = star_product(whole, whole)
        except IllPosedSegment:
            _, G, H = np.abs(whole).max(axis=(1, 2))
            raise refuse(bool(H * limits[1] >= G * limits[0]), whole) from None
        F, G, H = np.abs(twice).max(axis=(1, 2))
        if not limits[0] > H:
            raise refuse(True, twice)
        if not limits[1] > G:
            break
        moved, whole = np.abs(twice[2] - whole[2]).max(), twice
        if moved <= EPS * H and ROOT_EPS * scale >= F:
            return whole[2], k + 1
    raise refuse(False, whole)


def list_squares(Phi: Array) -> list[Array]:
    """Phi, Phi^2, Phi^4 ... until the next is rounding; none where Phi does not decay."""
    squares = [Phi]
    for _ in range(MAX_DOUBLINGS):
        with np.errstate(over="ignore", invalid="ignore"):
            Phi = Phi @ Phi
        size = float(np.square(Phi).sum())
        if size <= EPS:
            return squares
        if not np.isfinite(size):
            break
        squares.append(Phi)
    return []


def carry_back(Phi: Array, part: Array, behind: Array) -> Array:
    """D at the start of a stretch with transition matrix Phi, from its own part and D behind it."""
    return part + transpose(Phi) @ behind @ Phi


def twice(product: Array) -> Array:
    """P + P'."""
    return product + transpose(product)
