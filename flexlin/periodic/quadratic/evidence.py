"""Whether a solution is the stabilising one, and how wrong it is: its residual, carried through the closed loop's Lyapunov equation."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.fourier import FourierSeries, fourier_nodes
from flexlin.periodic.quadratic.collocated_lyapunov import CollocatedLyapunov, measure_states
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.scattering import symmetrize, transpose

ROUNDING = np.finfo(float).eps / 4
"""Rounding of a sum of products, relative to the sum of their sizes: 3 times the root mean square that was seen."""
SAFETY = 3.0
"""Factor on the errors that are found."""
FLOOR = 1e-3
"""Least weight of a state in W, relative to the largest, in units in which X has a diagonal of ones."""
CARRYING, WEIGHING = 1e-2, (1e-4, 1e-8)
"""Relative accuracies to which the errors and Y are asked for: Y anew where fast eigenvalues make much of what it misses."""
MOST_LEFT, MOST_CURVED = 0.5, 0.2
"""Largest share of W that Y may miss, and the largest curvature q, up to which the proof holds."""
LEAST_COST = 1e-12
"""Least eigenvalue of a running cost that is more than rounding."""
UNRESOLVED, HIDDEN = 0.05, 10.0
"""Share of the last quarter of the harmonics from which on E, if above rounding, is not resolved, and the factor that it then gets."""
PROBE = 20
"""Seed of the signs that rounding is given."""


@dataclass(frozen=True)
class Evidence:
    """Estimates of |X error| / max |X|, of its part that is not rounding, and of |K error| / max |K|; the largest residual."""

    error: float
    method_error: float
    gain_error: float
    residual: float


def find_error(problem: LinearQuadratic, X: FourierSeries, loop: Array, count: int) -> Evidence:
    """Prove that X lies near the stabilising solution X + E and find E from the residual between the nodes of X.

        E' + Ac' E + E Ac - E S E + F = 0,   Ac = A - S X,   F = X' + A' X + X A - X S X + Q

    A proof (`is_stable_by_cost`, `prove_stable`) also says that the term of second order is small. What is left is a Lyapunov
    equation, solved on more nodes: for F as it was computed, and for F as it might be rounded, with signs that are the same at
    all times and with signs that change at random. The first and the larger of the others, by a factor, are the error.

    Parameters: loop: A - S X (N, n, n) at the N nodes of X; count: of the nodes at which the residual is looked at.
    Raises: ToleranceNotReached when there is no proof or no E.
    """
    T = X.period
    t = fourier_nodes(count, T)
    A, S, Q = problem.reduced(t)
    values, rate = X(t), X(t, 1)
    finer, by_A = A - S @ values, values @ A
    if not np.diagonal(values, axis1=1, axis2=2).max() > 0:
        raise ToleranceNotReached("X is not positive", got="no positive entry on its diagonal")
    residual = rate + by_A + transpose(by_A) - values @ S @ values + Q
    sizes = np.abs(residual) + 8 * ROUNDING * sum_sizes(A, S, Q, values, rate)
    if not is_stable_by_cost(values, weigh(sizes, values), S, Q):
        prove_stable(X, loop, sizes, finer, S)
    lyapunov = CollocatedLyapunov(finer, T, values)
    roundings = draw_roundings(A, S, Q, values, rate)
    parts = [lyapunov.solve(F, CARRYING, 10 * CARRYING) for F in (residual, *roundings)]
    to_gain = np.linalg.solve(problem.R(t), transpose(problem.B(t)))
    return weigh_parts(parts, values, residual, to_gain, problem.gain(t, values))


def weigh_parts(parts: list[Array], X: Array, residual: Array, to_gain: Array, gain: Array) -> Evidence:
    """Return what the parts of E say: that of the residual as it was computed, then those of what it might be rounded by.

    to_gain: R^-1 B'. All (N, ., .) at the same times.
    """
    if np.abs(parts[0]).max() > max(np.abs(part).max() for part in parts[1:]) and find_tail(parts[0]) > UNRESOLVED:
        parts = [HIDDEN * parts[0], *parts[1:]]
    size, height = float(np.abs(X).max()) or 1.0, float(np.abs(gain).max()) or 1.0
    product = 8 * ROUNDING * float((np.abs(to_gain) @ np.abs(X)).max())
    return Evidence(
        SAFETY * add_up(parts) / size + 8 * ROUNDING,
        SAFETY * float(np.abs(parts[0]).max()) / size,
        (SAFETY * add_up([to_gain @ E for E in parts]) + product) / height,
        float(np.abs(residual).max()),
    )


def find_tail(X: Array) -> float:
    """Return the size of the last quarter of the harmonics of samples (N, n, n), relative to the largest entry."""
    size = np.abs(np.fft.rfft(X, axis=0)).max(axis=(1, 2))
    return float(size[-(len(size) // 4) :].max() / (size.max() or 1.0))


def add_up(parts: list[Array]) -> float:
    """Return the largest entry of the first part, plus the largest of all others."""
    first, *others = (float(np.abs(part).max()) for part in parts)
    return first + max(others)


def sum_sizes(A: Array, S: Array, Q: Array, X: Array, rate: Array) -> Array:
    """Return |X'| + |X| |A| + |A|' |X| + |X| |S| |X| + |Q|, entry by entry."""
    X, product = np.abs(X), np.abs(X) @ np.abs(A)
    return np.asarray(np.abs(rate) + product + transpose(product) + X @ np.abs(S) @ X + np.abs(Q))


def draw_roundings(A: Array, S: Array, Q: Array, X: Array, rate: Array) -> list[Array]:
    """Return what rounding may make of the residual, with signs that are the same at all times, and with signs that change."""
    signs = np.random.default_rng(PROBE).choice([-1.0, 1.0], (2, *X.shape))
    signs[0] = signs[0, 0]
    return [draw_rounding(A, S, Q, X, rate, sign) for sign in signs]


def draw_rounding(A: Array, S: Array, Q: Array, X: Array, rate: Array, signs: Array) -> Array:
    """Return what rounding may make of X' + A' X + X A - (X S) X + Q, with the given signs.

    What is lost in X S is multiplied by X: where X S is a small difference, as in cheap control, that matters less than its size.
    """
    sizes = np.abs(rate) + np.abs(Q) + np.abs(X @ S) @ np.abs(X) + 2 * np.abs(X) @ np.abs(A)
    inner = (np.abs(X) @ np.abs(S)) * np.swapaxes(signs, 1, 2)
    return ROUNDING * symmetrize(sizes * signs + 2 * inner @ X)


def is_stable_by_cost(X: Array, W: Array, S: Array, Q: Array) -> bool:
    """Say whether X itself proves its loop stable and near: a Lyapunov function whose decay is the running cost.

        X' + Ac' X + X Ac = F - C,   C = Q + X S X > 0,   -r C <= F <= r C with r = tr(C^-1 W)

    It is as in `prove_stable` with Y = r X. Parameters: X, S, Q (M, n, n) at the times of F; W (n,) with -diag(W) <= F <= diag(W).
    """
    units = measure_states(X)
    both = np.outer(units, units)
    cost, X, S = (Q + X @ S @ X) / both, X / both, S * both
    if not (np.linalg.eigvalsh(cost)[:, 0].min() > LEAST_COST * np.abs(cost).max() and np.linalg.eigvalsh(X[0])[0] > 0):
        return False
    inverse = np.linalg.inv(cost)
    share = float((np.diagonal(inverse, axis1=1, axis2=2) @ (W / units**2)).max())
    curved = share * np.einsum("tij,tji->t", S, X) * np.einsum("tij,tji->t", inverse, X)
    return bool(share <= MOST_LEFT and curved.max() <= MOST_CURVED * (1 - share) ** 2)


def prove_stable(X: FourierSeries, loop: Array, sizes: Array, finer: Array, S: Array) -> None:
    """Prove that the loop of X is stable and that the stabilising solution lies near.

    Let -W <= F <= W with a constant diagonal W > 0, and Y' + Ac' Y + Y Ac <= -(1 - theta) W at all times. By Lyapunov's theorem
    the loop is stable if Y > 0 at one time. With q = tr(S Y) tr(W^-1 Y) / (1 - theta)^2 < 1/4 the map that takes E to the solution
    of the Lyapunov equation with F - E S E keeps -k Y <= E <= k Y for k (1 - theta) = 2 / (1 + sqrt(1 - 4 q)): E is in there.
    Assumes that F is smooth between the times of `sizes`.

    Parameters: sizes (M, n, n): bounds on |F|; loop (N, n, n): Ac at the nodes of X; finer, S (M, n, n): Ac and S at the times of sizes.
    Raises: ToleranceNotReached when Y proves nothing.
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 4 (periodic Lyapunov inequality).
    """
    T, t = X.period, fourier_nodes(len(finer), X.period)
    W = weigh(sizes, X(t))
    units = np.sqrt(np.outer(W, W))
    right = np.broadcast_to(-np.diag(W), loop.shape)
    lyapunov = CollocatedLyapunov(loop, T, X.values)
    for accuracy in WEIGHING:
        Y = FourierSeries.through(lyapunov.solve(right, accuracy, 10 * accuracy), T)
        at = Y(t)
        drift = at @ finer
        theta = float(np.linalg.norm((Y(t, 1) + drift + transpose(drift) + np.diag(W)) / units, 2, axis=(1, 2)).max())
        trace = np.einsum("tij,tji->t", S, at) * np.trace(at / units, axis1=1, axis2=2)
        small = theta <= MOST_LEFT and trace.max() <= MOST_CURVED * (1 - theta) ** 2
        if small and np.linalg.eigvalsh(at[0] / units)[0] > 0:
            return
    raise ToleranceNotReached(
        "the closed loop was not proved stable", got=f"a share of {theta:.2g}, curvature {trace.max():.2g}"
    )


def weigh(sizes: Array, X: Array) -> Array:
    """Return the diagonal of W (n,) with -W <= F(t) <= W for all |F(t)| <= sizes (N, n, n).

    By Gershgorin's theorem, in units d in which X has about a diagonal of ones:  W_i = max over t of sum_j |F_ij| d_i / d_j.
    """
    units = measure_states(X)
    W = (sizes / units).sum(axis=2).max(axis=0) / units
    return np.asarray(np.maximum(W, FLOOR * W.max()) * units**2)
