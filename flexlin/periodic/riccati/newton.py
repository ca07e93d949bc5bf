"""The Riccati equation by Newton's method on the series of X, begun from products doubled until their cost rests; error by residual."""

from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError, ToleranceNotReached
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix, couple_uncertainty
from flexlin.periodic.coefficients import assemble_hamiltonian
from flexlin.periodic.interpolation import ChebyshevPanels, FourierSeries
from flexlin.periodic.riccati.linear_quadratic import (
    WEIGHT_TIMES,
    LinearQuadratic,
    RiccatiSolution,
    bound_sizes,
    name_blocked_mode,
)
from flexlin.periodic.riccati.nodes import Nodes
from flexlin.periodic.riccati.scattering import (
    LoopLyapunov,
    carry_costs_down,
    double_until_rest,
    grow_tree,
    scatter_exponentials,
    star_product,
    step_exactly,
    symmetrize,
    transpose,
    twice,
)
from flexlin.periodic.transition.factors import Resolved
from flexlin.periodic.transition.gauss import CHUNK_BYTES
from flexlin.precision import EPS, MINOR, PARTIAL, ROOT_EPS, SAFETY, SLIGHT

MOST_NODES = 8192
"""Nodes at the most."""
CORRECTIONS = 24
"""Corrections on a grid."""
EASIER_FACTOR = 100.0
"""The factor on R, taken CORRECTIONS // 4 times at the most."""


def solve_by_newton(
    problem: LinearQuadratic, nodes: Nodes, end: Array | None, tol: float, eased: int = 0, bounded: bool = True
) -> RiccatiSolution:
    """Solve on ever finer nodes until the bound on the error meets tol; the best answer, with its status.

    Where cheap inputs turn, steps of a coarse start let them push in more directions than they do. Then R is made larger until it is none
    too coarse: by the gain margin of the optimal loop, its X with the smaller R stabilises too.

    Parameters: eased: how often that was done; bounded: whether the error is asked about, which takes as long as X.
    Raises: NotStabilizable, NotDetectable; ToleranceNotReached where nothing is proved.
    """
    best: RiccatiSolution | None = None
    start, X, doublings = begin(problem, nodes.resize(WEIGHT_TIMES), end)
    idle, seen = end is None and not doublings, MINOR * tol  # a period is doubled where there is an input
    nodes = nodes.resize(max(nodes.count, start.count))
    X = start.series(X)(nodes.places)
    while nodes.count <= most_nodes(X.shape[1]):
        corrected = correct_until_closed(problem, nodes, X, SLIGHT * tol)
        if corrected is None and start.count < MOST_NODES // (4 if idle else 8):
            start, X, doublings = begin(problem, start.resize(4 * start.count), end)
            nodes = nodes.resize(max(nodes.count, start.count))
            X = start.series(X)(nodes.places)
            continue
        if corrected is None:
            if idle:
                break
            begin(problem, start, end, exact=True)
            if best is not None or eased == CORRECTIONS // 4:
                break
            try:
                X = solve_by_newton(problem.ease(EASIER_FACTOR), nodes, end, SLIGHT, eased + 1).X(nodes.places)
            except NumericalError:
                break
            eased = CORRECTIONS // 4
            continue
        finer = nodes.refine(corrected.X, seen)
        if finer is None and not bounded:
            return corrected.solution(problem, np.full(corrected.X.shape[1:], inf))
        if finer is None:
            found = bound_error(problem, corrected, tol)
            if found is None:
                finer = nodes.resize(2 * nodes.count)
            else:
                missed = max(found.error, found.gain_error) / tol
                worse = missed > 1 and best is not None and 2 * found.error > best.error  # more nodes are not worth it
                best = best if worse else replace(found, doublings=doublings)
                if worse or missed <= 1 or 2 * found.method_error <= found.error:
                    break
                seen *= MINOR / min(missed, 1 / MINOR)
                finer = nodes.refine(corrected.X, seen) or nodes.resize(2 * nodes.count)
        X, nodes = corrected.series(finer.places), finer
    if best is None:
        raise ToleranceNotReached(
            "the Riccati equation was not solved to the asked accuracy: its coefficients may lie too far apart to be computed with",
            got=problem.describe_sizes(nodes.t[:WEIGHT_TIMES]),
            expected=f"a proof of an error of at most {tol:.2g} on up to {nodes.count} nodes",
            todo="bring states, inputs and weights to like sizes (a small R makes fast modes), or ask for a larger tol",
        )
    limited = f"limited by rounding: error {best.error:.1g} above the asked {tol:.1g}; ask for tol={2 * best.error:.0e}"
    return best if best.error <= tol else replace(best, status=limited)


def begin(problem: LinearQuadratic, nodes: Nodes, end: Array | None, exact: bool = False) -> tuple[Nodes, Array, int]:
    """About X at the nodes or at more of them, and how often the period was doubled for it, not at all without an input.

    By segments on which the Hamiltonian is held constant half-way to each neighbour: well posed however coarse.
    exact: an X that rounding might have made is none then.
    Raises: NotStabilizable, NotDetectable, with the mode's name.
    """
    A, S, Q = problem.reduced(nodes.t)
    if not S.any() and end is None:
        with np.errstate(over="ignore", invalid="ignore"):
            X = LoopLyapunov(A, nodes, step_exactly(problem.A, nodes, np.ones(A.shape[1]))).solve(Q)
        if X is not None:
            return nodes, np.where(np.isfinite(X), X, 0.0), 0  # what numbers do not hold, no correction settles
        if 4 * nodes.count <= most_nodes(A.shape[1]):
            return begin(problem, nodes.resize(4 * nodes.count), end)
    H = assemble_hamiltonian(A, S, Q)
    halves = scatter_exponentials((nodes.halves[:, :, None, None] * H).reshape(-1, *H.shape[1:]))
    count = nodes.count
    gaps = star_product(halves[:, -count:], np.roll(halves[:, :count], -1, axis=1))
    levels, doublings = grow_tree(gaps, star_product), 0
    if end is None:
        of_H, of_G = bound_sizes(problem, nodes.period)
        limits = (ROOT_EPS * of_H, ROOT_EPS * of_G) if exact else (of_H, of_G)
        end, doublings = double_until_rest(
            levels[-1][:, 0], limits, lambda grows, _: name_blocked_mode(grows, problem, nodes.edges)
        )
    return nodes, carry_costs_down(levels, end)[:count], doublings


def most_nodes(n: int) -> int:
    """Nodes at the most for n states."""
    return min(MOST_NODES, CHUNK_BYTES // (8 * n**2))


@dataclass(frozen=True)
class Corrected:
    """X at nodes in units of the states, the coefficients there, and the Lyapunov equation of its loop."""

    nodes: Nodes
    X: Array
    samples: "Samples"
    lyapunov: LoopLyapunov

    @property
    def series(self) -> ChebyshevPanels | FourierSeries:
        """X in the states' own units."""
        return self.nodes.series(self.X * np.outer(self.samples.units, self.samples.units))

    def solution(
        self, problem: LinearQuadratic, entries: Array, errors: tuple[float, float, float] = (inf, inf, inf)
    ) -> RiccatiSolution:
        """With the errors of X's entries, of X, of the gain and of the method where they are known."""
        nodes = self.nodes
        all_errors = *errors, entries
        return RiccatiSolution(
            problem, nodes.period, nodes.wraps, self.series, *all_errors, 0, nodes.count, "converged"
        )


def correct_until_closed(problem: LinearQuadratic, nodes: Nodes, X: Array, near: float) -> Corrected | None:
    """Correct X at the nodes until it changes by less than `near`, or by what the nodes do not show; None where that does not settle.

        -D' = Ac' D + D Ac + F,   X <- X + D,   F the residual of X, Ac = A - B R^-1 B' X

    The steps are those of Newton's method (Kleinman) where the loop is new; then it is kept, and each corrects what the last one missed.
    Without an input it is the same from the beginning.
    Source: Kleinman, IEEE Trans. Automat. Control 13 (1968) 114; Dutt, Greengard, Rokhlin, BIT 40 (2000) 241 (deferred correction).
    """
    A, G, Q = problem.factored(nodes.t)
    units = measure_states(X, A)
    samples, X = Samples.of(A, G, Q, units), X / np.outer(units, units)
    last, grown = np.inf, 0
    for k in range(CORRECTIONS):
        F, M = samples.compare(X, nodes.slopes(X))
        with np.errstate(over="ignore", invalid="ignore"):  # of loops that are not stable
            if not k or (last > SLIGHT and samples.G.any()):
                free = not samples.G.any()  # without an input the loop is A
                exact = step_exactly(problem.A, nodes, units) if free else None
                lyapunov = LoopLyapunov(M, nodes, exact)
            D = lyapunov.solve(F)
        if D is None:
            return None
        moved = float(np.abs(D).max())
        X = X + (nodes.sharpen(D, lyapunov.exact) if moved < SLIGHT else D)
        grown = grown + 1 if moved > last else 0
        if not moved * SLIGHT < 1 or grown > CORRECTIONS // 8:  # as steps grow on too few nodes
            return None
        small = moved <= near or (k and moved * moved / last <= near)
        if small or (moved < MINOR and moved <= nodes.tail(X)) or (moved < SLIGHT and moved > PARTIAL * last):
            return Corrected(nodes, X, samples, lyapunov)
        last = moved
    return None


def bound_error(problem: LinearQuadratic, corrected: Corrected, tol: float) -> RiccatiSolution | None:
    """Put the solution together with a bound on its error from its residual F between the nodes; None where this proves nothing.

        -D' = Ac' D + D Ac + W + G,   -W <= F <= W,   -r W <= G <= r W,   D > 0 at one time

    W is diagonal, and constant but on panels of a rounding's length, so that D is as smooth as the loop. G is what is left over of D's
    own equation. With D1 = D / (1 - r), by Lyapunov's theorem the loop Ac is stable. An error E of X obeys Lyapunov's equation with the
    right side F - E S E, S = G G'; with q = max tr(S D1) tr(W^-1 D1) < 1/4 the map from E to its solution keeps

        -k D1 <= E <= k D1,   |E_ij| <= k sqrt(D1_ii D1_jj),   k = 2 / (1 + sqrt(1 - 4 q))

    The signs of F are as bad as can be in this. Where that misses tol, E is what the loop makes of F as it was computed, and of F as it
    might be rounded (`carry_residual`), by a factor. F is looked at twice as often as X: waves that the nodes show rise between these
    times by 1 / cos(pi / 4) at the most.
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 4 (periodic Lyapunov equation and inequality); Ehlich, Zeller, Math. Z. 86
    (1964) 41 (polynomials between nodes).
    """
    nodes, X, units, lyapunov = corrected.nodes, corrected.X, corrected.samples.units, corrected.lyapunov
    between, panels = nodes.between, len(nodes.edges) - 1
    samples = Samples.of(*problem.factored(between), units)
    X_between, slopes = nodes.look_between(X)
    F, M = samples.compare(X_between, slopes)
    nodal, _ = corrected.samples.compare(X, nodes.slopes(X))
    noise = samples.rounding(X_between, slopes)
    doubt = samples.doubt(problem, between, X_between)
    looked = F, nodal, noise + doubt
    seen, at_nodes, lost = (np.abs(one).sum(axis=2).reshape(panels, -1, len(units)).max(axis=1) for one in looked)
    rows = [sqrt(2) * np.maximum(seen, at_nodes), lost]
    short = np.diff(nodes.edges) <= ROOT_EPS * nodes.period
    for part in rows:
        part[~short] = part[~short].max(axis=0)
    W = rows[0] + rows[1]
    W = np.maximum(W, SLIGHT * W.max(axis=1, keepdims=True) + 1e-100)
    W_between, W_nodes = (np.repeat(W, count // panels, axis=0) for count in (len(between), nodes.count))
    weight = W_nodes[:, :, None] * np.eye(len(units))
    D, left = np.zeros_like(X), weight
    for _ in range(CORRECTIONS // 4):
        more = lyapunov.solve(left)
        if more is None:
            return None
        D = D + nodes.sharpen(more, lyapunov.exact)
        D_between, D_slopes = nodes.look_between(D)
        missed = D_slopes + twice(D_between @ M) + W_between[:, :, None] * np.eye(len(units))
        scale = np.sqrt(W_between)
        share = float(np.linalg.norm(missed / scale[:, :, None] / scale[:, None, :], axis=(1, 2)).max())
        if share <= PARTIAL:
            break
        left = nodes.slopes(D) + twice(D @ lyapunov.M) + weight
    if not share <= PARTIAL or not np.linalg.eigvalsh(D[0])[0] > 0:
        return None
    pulled = (samples.G * (D_between @ samples.G)).sum(axis=(1, 2))
    q = float((pulled * (np.diagonal(D_between, axis1=1, axis2=2) / W_between).sum(axis=1)).max()) / (1 - share) ** 2
    k, both = 2 / (1 + sqrt(1 - 4 * min(q, 0.25))), np.outer(units, units)
    D = D * (k / (1 - share) * both)
    t, height = nodes.t, float(np.abs(X * both).max()) or 1.0
    to_gain = np.linalg.solve(problem.R(t), transpose(problem.B(t)))
    gain = float(np.abs(problem.gain(t, X * both)).max()) or 1.0
    heights = np.diagonal(D, axis1=1, axis2=2).max(axis=1)
    reached = ((to_gain @ D) * to_gain).sum(axis=2).max(axis=1)
    error, gain_error = float(heights.max()) / height, sqrt(float((reached * heights).max())) / gain
    errors = np.array([error, gain_error, error * float((rows[0] / W).max())]) if q < 0.25 else np.full(3, np.inf)
    each = np.sqrt(np.diagonal(D, axis1=1, axis2=2).max(axis=0)) if q < 0.25 else np.full(len(units), inf)
    entries = np.outer(each, each)
    if errors.max() > tol:
        carried = carry_residual(corrected, F, MINOR * noise + doubt / SAFETY, W_nodes)
        if carried is not None:
            entries = np.minimum(entries, SAFETY * add_up(carried) * both)
            parts = [part * both for part in carried]
            of_method = sum(float(np.abs(part).max()) for part in parts[:2])
            sizes = add_up(parts), add_up([to_gain @ part for part in parts]), of_method
            errors = np.minimum(errors, SAFETY * np.array(sizes) / [height, gain, height])
    if not np.isfinite(errors).all():
        return None
    late = EPS * nodes.period * nodes.place_behind(slopes * both)  # what X changes in the rounding of a time
    product = 2 * EPS * float((np.abs(to_gain) @ np.abs(X * both)).max()) + float(np.abs(to_gain @ late).max())
    of_X, of_gain, of_method = errors.tolist()
    of_X += 2 * EPS + float(np.abs(late).max()) / height
    entries = entries + 2 * EPS * np.abs(X * both).max(axis=0) + np.abs(late).max(axis=0)
    return corrected.solution(problem, entries, (of_X, of_gain + product / gain, of_method))


def carry_residual(corrected: Corrected, between: Array, noise: Array, W: Array) -> list[Array] | None:
    """What the loop makes of X's residual F and of its fastest waves in half a step, and what it makes of F's rounding with signs that
    are the same at all times or change.

    F and its rounding, `noise`, are known at the nodes and `between` them: each half of F is one sum. The first answer is corrected until
    it solves its equation to PARTIAL; None where that does not settle, or where what is of second order in all of them is no less than
    that of the residual's size W (N, n).
    """
    nodes, samples, loop = corrected.nodes, corrected.samples, corrected.lyapunov
    F, M = samples.compare(corrected.X, nodes.slopes(corrected.X))
    between, noise = nodes.place_behind(between), nodes.place_behind(noise)
    swing = loop.integrate_behind(0.5 * (F + between))
    before, behind = np.broadcast_to(nodes.halves, (2, nodes.count))[:, :, None, None]
    sides = behind * between + np.roll(behind * between, 1, axis=0)
    F = nodes.smooth(0.5 * (F + sides / (before + behind)))
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (2, *F.shape))
    signs[0] = signs[0, 0]
    others = [loop.solve(symmetrize(noise * sign)) for sign in signs]
    E, left, moved = np.zeros_like(F), F, np.inf
    for _ in range(CORRECTIONS // 4):
        more = loop.solve(left)
        if more is None or others[0] is None or others[1] is None:
            return None
        E, last, moved = E + more, moved, float(np.abs(more).max())
        if moved <= PARTIAL * float(np.abs(E).max()):
            parts = [E, swing, others[0], others[1]]
            pulled = [np.square(part @ samples.G / np.sqrt(W)[:, :, None]).sum(axis=(1, 2)) for part in parts]
            return parts if SAFETY**2 * add_up(pulled) <= PARTIAL else None
        if moved > last:
            break
        left = F + nodes.slopes(E) + twice(E @ M)
    return None


def add_up(parts: list[Array]) -> float:
    """The largest entries of the first two parts, plus the largest of all others."""
    first, second, *others = (float(np.abs(part).max()) for part in parts)
    return first + second + max(others)


@dataclass(frozen=True)
class Samples:
    """Ar, G with G G' = B R^-1 B', and Qr of a problem at times, in units of the states."""

    A: Array
    G: Array
    Q: Array
    units: Array

    @classmethod
    def of(cls, A: Array, G: Array, Q: Array, units: Array) -> "Samples":
        """From those in the states' own units."""
        return cls(A * (units[:, None] / units), G * units[:, None], Q / np.outer(units, units), units)

    def compare(self, X: Array, slopes: Array) -> tuple[Array, Array]:
        """The residual F = X' + A' X + X A - X G G' X + Q, and the loop A - G G' X."""
        pull = transpose(self.G) @ X
        F = slopes + twice(X @ self.A)
        F -= transpose(pull) @ pull
        F += self.Q
        return F, self.A - self.G @ pull

    def doubt(self, problem: LinearQuadratic, t: Array, X: Array) -> Array:
        """What A and Q, as they were represented and rounded, leave unknown of the residual of a loop without an input."""
        missed, both = np.zeros_like(X), np.outer(self.units, self.units)
        if self.G.any():
            return missed
        if isinstance(problem.A, Resolved):
            eye = np.broadcast_to(np.eye(X.shape[2]), X.shape)
            missed += twice(couple_uncertainty(problem.A, t, X * both, eye, in_mean=True) / both)
        if isinstance(problem.Q, ResolvedMatrix):
            missed += problem.Q.error_near(t) / both
        return missed

    def rounding(self, X: Array, slopes: Array) -> Array:
        """Of the residual, by the sizes of all that is added in it; what is lost in G' X is multiplied by G' X."""
        pull = transpose(self.G) @ X
        by_pull = transpose(np.abs(pull)) @ (transpose(np.abs(self.G)) @ np.abs(X))
        return 2 * EPS * (np.abs(slopes) + twice(np.abs(X) @ np.abs(self.A) + by_pull) + np.abs(self.Q))


def measure_states(X: Array, A: Array) -> Array:
    """The root of the sizes of the largest diagonal entries of X (N, n, n), as powers of two: (n,).

    None is so small that A would be larger in these units than it is: where X hardly sees a state that others hang on, sums cancel.
    """
    size = np.abs(A).max(axis=0)
    share = size / (size.max() or 1.0)
    units = np.sqrt(np.abs(np.diagonal(X, axis1=1, axis2=2)).max(axis=0))
    units = np.maximum(units, 1e-12 * units.max() or 1.0)
    for _ in units:
        units = np.maximum(units, (share * units[:, None]).max(axis=0))
    return np.asarray(2.0 ** np.round(np.log2(units)))
