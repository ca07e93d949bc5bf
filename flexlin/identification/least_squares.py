"""Gauss-Newton steps over starting states of windows and numbers that all windows share, damped after Levenberg and Marquardt.

Each window's states are eliminated by an orthogonal factorization of its own rows; what is left of all windows is a small problem for
the shared numbers, with bounds. What the fit then knows: covariance, numbers that cannot be parted, colour of residuals.
Source: Golub, Pereyra (2003), Separable nonlinear least squares, Inverse Problems 19, R1.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import lsq_linear

from flexlin.bounds import LARGEST_NUMBER
from flexlin.checks import Array
from flexlin.identification.shooting import Shooting

SMALLEST_NORM = 1e-5
"""Share of the largest column below which a column's norm counts as this much: what no reading sees then stays where it was."""
UNKNOWN_DEVIATION = 1.0
"""Standard deviation of a direction, numbers in units of their sizes, from which on the log does not know it."""
DIRECTION_SHARE = 0.2
"""Share of such a direction from which on a number belongs to it."""
NOTED_CORRELATION = 0.9
"""Correlation that is worth a word."""
WHITE_DEVIATIONS = 3.0
"""Correlation of neighbours, in standard deviations of that of white noise, from which on residuals are coloured."""
STEP_REACH = 2.0
"""Times its size, or that in the scene, by which a step may change a number that has no sign: farther off no slope leads back."""
RESIDUAL_BLOCKS = 4
"""Of a window: residuals that are farther apart than one, and sums over each, count as independent."""


@dataclass(eq=False)
class Point:
    """Starting states (W, 2n), shared numbers (n_p,), and what they leave: residuals over their standard deviations, (W, N, outputs).

    damping: of the next step; jacobian: of the readings, once it was asked for.
    """

    start: Array
    p: Array
    states: Array
    residual: Array
    damping: float = 1e-3
    jacobian: Array | None = field(default=None, init=False)

    @property
    def costs(self) -> Array:
        """Half the sum of squares of each window; infinite where it diverges."""
        found = 0.5 * np.einsum("wnj,wnj->w", self.residual, self.residual)
        return np.where(np.isfinite(found), found, np.inf)

    @property
    def cost(self) -> float:
        """That of all windows."""
        return float(self.costs.sum())


@dataclass(frozen=True, eq=False)
class Problem:
    """Readings (W, N, outputs) to be met within sigma (outputs,), and bounds of the shared numbers; no bounds, no numbers are moved.

    usual: sizes of the shared numbers in the scene; `allows`: whether they go together; where they do not, the cost is infinite.
    """

    shooting: Shooting
    readings: Array
    sigma: Array
    low: Array
    high: Array
    usual: Array
    allows: Callable[[Array], bool] = lambda p: True

    def at(self, start: Array, p: Array) -> Point:
        """Simulate from a point."""
        with np.errstate(all="ignore"):
            states = self.shooting.run(start, p)
            residual = self.weigh(self.readings - self.shooting.predict(states, p), p)
        if not self.allows(p[: len(self.low)]):
            residual = np.full_like(residual, np.inf)
        return Point(start, p, states, residual)

    def reweighed(self, point: Point, sigma: Array) -> tuple["Problem", Point]:
        """The same problem and point with other deviations, for which nothing is simulated anew."""
        made = replace(point, residual=point.residual * (self.sigma / sigma))
        made.jacobian = point.jacobian
        return replace(self, sigma=sigma), made

    def weigh(self, values: Array, p: Array) -> Array:
        """Over sigma, and zero where nothing was measured or the window had not begun when the sensor saw it."""
        seen = np.isfinite(self.readings)
        for j, delay in enumerate(self.shooting.delays(p)[1]):
            seen[:, :, j] &= self.shooting.windows.places(delay) > -1e-6
        extra = (1,) * (values.ndim - 3)
        weights = (seen / self.sigma).reshape(*seen.shape, *extra)
        return np.where(weights > 0, values * weights, 0.0)

    def limited(self, p: Array) -> Array:
        """Which numbers are at a bound."""
        return (p <= self.low + 1e-9) | (p >= self.high - 1e-9)

    def ends(self, p: Array) -> tuple[Array, Array]:
        """Where the next step may end; a number that is 0 in the scene has no size to go by."""
        reach = np.where((self.low >= 0) & (self.usual > 0), STEP_REACH * np.maximum(np.abs(p), self.usual), np.inf)
        return np.maximum(self.low, p - reach), np.minimum(self.high, p + reach)

    def sizes(self, point: Point) -> Array:
        """What errors of the shared numbers are held against: these or those in the scene, or else what moves readings by their noise."""
        moved = np.linalg.norm(self.slopes(point)[:, :, point.start.shape[1] :], axis=(0, 1))
        seen = np.count_nonzero(self.weigh(np.ones_like(point.residual), point.p))
        noise = np.sqrt(seen) / np.maximum(moved, 1e-300)
        return np.asarray(np.maximum(np.abs(point.p), np.where(self.usual > 0, self.usual, noise)))

    def slopes(self, point: Point) -> Array:
        """Of the weighted readings by start and p, (W, N outputs, 2n + n_p); zero where their squares could overflow."""
        if point.jacobian is None:
            with np.errstate(all="ignore"):
                point.jacobian = self.shooting.jacobian(point.states, point.p)
        found = self.weigh(point.jacobian[..., : point.start.shape[1] + len(self.low)], point.p)
        found = np.where(np.abs(found) <= LARGEST_NUMBER, found, 0.0)
        return found.reshape(found.shape[0], -1, found.shape[3])

    def condensed(self, point: Point) -> tuple[Array, Array]:
        """Fewer rows with the same least-squares problem: R = Q' [slopes, residual] of each window; zeros where it diverges."""
        lost = ~np.isfinite(point.costs)[:, None, None]
        rows = np.concatenate([self.slopes(point), point.residual.reshape(len(point.start), -1, 1)], axis=2)
        lost = lost | ~(np.abs(rows) <= LARGEST_NUMBER)  # norms of what is larger may overflow
        R = np.asarray(np.linalg.qr(np.where(lost, 0.0, rows), mode="r"))
        return R[:, :, :-1], R[:, :, -1]


def solve(
    problem: Problem, point: Point, iterations: int = 30, tol: float = 1e-6, late: Callable[[], bool] = bool
) -> Point:
    """The least sum of squares that damped Gauss-Newton steps find from here until it is late; without shared numbers each window goes
    its own way."""
    dampings = np.full(len(point.start), point.damping)
    for _ in range(iterations):
        if late() or not np.isfinite(point.costs).any():
            break
        slopes, residual = problem.condensed(point)
        gained = np.zeros(len(dampings))
        for _ in range(8):
            to = take_step(problem, point, slopes, residual, dampings)
            trial = problem.at(*to)
            with np.errstate(invalid="ignore"):
                gain = together(problem, point.costs - trial.costs)
            better = gain > 0
            point, gained = choose(point, trial, better), np.where(better, gain, gained)
            dampings = dampings * np.where(better, 0.2, 5.0)
            if better.any() or late():
                break
        if np.all(gained <= tol * together(problem, point.costs)):
            break
    point.damping = float(dampings.max())
    return point


def together(problem: Problem, costs: Array) -> Array:
    """Of all windows where they share numbers, else of each."""
    costs = np.where(np.isnan(costs), -np.inf, costs)
    return np.full(len(costs), costs.sum()) if len(problem.low) else costs


def choose(point: Point, trial: Point, better: Array) -> Point:
    """The trial in the windows in which it is better."""
    if better.all():
        return trial
    wide = better[None, :, None]
    return replace(
        point,
        start=np.where(better[:, None], trial.start, point.start),
        states=np.where(wide, trial.states, point.states),
        residual=np.where(better[:, None, None], trial.residual, point.residual),
    )


def eliminate(slopes: Array, residual: Array, size: int, damping: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Take the starting states out: scales D (W, size), Q, R, what projects onto it, and the rest of columns of p and residual.

    min |J_x dx + J_p dp - r|: with J_x D^-1 = Q R, the rest is (I - Q Q') [J_p, r].
    """
    J, other = slopes[:, :, :size], np.concatenate([slopes[:, :, size:], residual[:, :, None]], axis=2)
    norms = np.linalg.norm(J, axis=1)
    scale = np.maximum(norms, SMALLEST_NORM * norms.max(axis=1, keepdims=True)) + 1e-300
    damped = np.sqrt(damping)[:, None, None] * np.eye(size)
    Q, R = np.linalg.qr(np.concatenate([J / scale[:, None, :], damped], axis=1))
    other = np.concatenate([other, np.zeros((len(J), size, other.shape[2]))], axis=1)
    onto = np.swapaxes(Q, 1, 2) @ other
    return scale, Q, R, onto, other - Q @ onto


def take_step(problem: Problem, point: Point, slopes: Array, residual: Array, damping: Array) -> tuple[Array, Array]:
    """Starting states and shared numbers after a damped step; the shared numbers stay within their bounds."""
    scale, _, R, onto, rest = eliminate(slopes, residual, point.start.shape[1], damping)
    move = np.zeros(len(problem.low))
    if len(move):
        R_p = np.asarray(np.linalg.qr(rest.reshape(-1, rest.shape[2]), mode="r"))
        norms = np.linalg.norm(R_p[:, :-1], axis=0)
        sizes = 1 / np.maximum(norms, SMALLEST_NORM * norms.max() + 1e-300)
        rows = np.concatenate([R_p[:, :-1] * sizes, np.sqrt(damping[0]) * np.eye(len(move))])
        wanted = np.concatenate([R_p[:, -1], np.zeros(len(move))])
        low, high = problem.ends(point.p)
        ends = (low - point.p) / sizes - 1e-12, (high - point.p) / sizes + 1e-12
        move = np.clip(point.p + sizes * lsq_linear(rows, wanted, ends).x, low, high) - point.p
    move_all = np.concatenate([move, np.zeros(len(point.p) - len(move))])
    y = np.linalg.solve(R, onto[:, :, -1:] - onto[:, :, :-1] @ move[:, None])[:, :, 0]
    return point.start + y / scale, point.p + move_all


@dataclass(frozen=True, eq=False)
class Evidence:
    """The numbers that are known, their errors, covariance (k, k) and large correlations; groups of numbers that are not; numbers at a
    limit; the correlation of neighbouring residuals of each column, and whether that is colour.

    ahead: the standard errors by which one more step, undamped, would move a number; spent: the readings of each column that numbers and
    starting states meet whatever they are, sum of h_ii of H = J (J' J)^-1 J'.
    """

    known: tuple[str, ...]
    errors: dict[str, float]
    covariance: Array
    correlations: dict[str, float]
    unknown: tuple[tuple[str, ...], ...]
    limited: tuple[str, ...]
    colour: Array
    coloured: bool
    ahead: float = 0.0
    spent: Array | float = 0.0


def weigh_evidence(problem: Problem, point: Point, paths: list[str]) -> Evidence:
    """Covariance (J' J)^-1 of the numbers with the starting states taken out; C S C of coloured residuals, see `with_colour`."""
    size, windows = point.start.shape[1], len(point.start)
    slopes, residual = problem.slopes(point), point.residual.reshape(windows, -1)
    _, Q, *_, rest = eliminate(slopes, residual, size, np.full(windows, 1e-12))
    Q, rest = (one[:, : residual.shape[1]] for one in (Q, rest))
    at_limit = problem.limited(point.p)
    inside = np.flatnonzero(~at_limit)
    scale = problem.sizes(point)[inside]
    J = rest[:, :, inside] * scale
    values, V = np.linalg.eigh(np.einsum("wri,wrj->ij", J, J))
    deviation = 1 / np.sqrt(np.maximum(values, 1e-300))
    lost = deviation > UNKNOWN_DEVIATION
    groups = group_directions(np.abs(V[:, lost]) > DIRECTION_SHARE)
    out = sorted({i for group in groups for i in group})
    C = (V[:, ~lost] / values[~lost]) @ V[:, ~lost].T
    ahead = scale * (C @ np.einsum("wri,wr->i", J, rest[:, :, -1]))
    spent = np.sum(Q**2, axis=2) + np.sum((J @ C) * J, axis=2)
    colour, coloured = find_colour(problem, point)
    if coloured:
        C = with_colour(C, J, point.residual)
    kept = [i for i in range(len(inside)) if i not in out]
    C = C[np.ix_(kept, kept)] * np.outer(scale[kept], scale[kept])
    errors = {paths[inside[i]]: float(np.sqrt(C[k, k])) for k, i in enumerate(kept)}
    far = max((abs(float(ahead[i])) / errors[paths[inside[i]]] for i in kept), default=0.0)
    unknown = tuple(tuple(paths[inside[i]] for i in group) for group in groups)
    limited = tuple(paths[k] for k in np.flatnonzero(at_limit))
    known = tuple(path for path in paths if path in errors or path in limited)
    whole = np.full((len(known), len(known)), np.nan)
    places = [known.index(path) for path in errors]
    whole[np.ix_(places, places)] = C
    every = {path: errors.get(path, float("nan")) for path in known}
    large, spent = name_correlations(list(errors), C), spent.reshape(point.residual.shape).sum(axis=(0, 1))
    return Evidence(known, every, whole, large, unknown, limited, colour, coloured, far, spent)


def leave_unknown(problem: Problem, point: Point, paths: list[str]) -> Evidence:
    """Of a point at which no search has settled: its numbers, without a word on their errors."""
    errors, unsure = dict.fromkeys(paths, float("nan")), np.full((len(paths), len(paths)), np.nan)
    return Evidence(tuple(paths), errors, unsure, {}, (), (), find_colour(problem, point)[0], False)


def group_directions(members: Array) -> list[list[int]]:
    """Numbers that share a direction (columns), joined where two directions share a number."""
    from scipy.sparse.csgraph import connected_components

    count, label = connected_components(members @ members.T)
    groups = [np.flatnonzero((label == i) & members.any(axis=1)).tolist() for i in range(count)]
    return [group for group in groups if group]


def with_colour(C: Array, J: Array, residual: Array) -> Array:
    """The covariance C S C of coloured residuals, of two the wider: few sums say little, and model errors are not stationary.

    S = sum w_k J_t' R_k J_(t - k), the covariances R_k of each column's residuals up to a block apart, w_k = 1 - k / lags; or S = sum b b',
    b the sums of J' r over blocks. No variance is made smaller by it.
    Source: Newey, West (1987), A simple, positive semi-definite covariance matrix, Econometrica 55, 703.
    """
    samples, J, S = residual.shape[1], J.reshape(*residual.shape, -1), np.zeros_like(C)
    lags = max(1, samples // RESIDUAL_BLOCKS)
    for lag in range(lags):
        now, then, weight = slice(lag, None), slice(None, samples - lag), (1 - lag / lags) * (1 + (lag > 0))
        both = residual[:, now] * residual[:, then]
        size = both.sum(axis=(0, 1)) / np.maximum(np.count_nonzero(both, axis=(0, 1)), 1)
        S += np.einsum("wnji,wnjk->ik", weight * size[:, None] * J[:, now], J[:, then])
    edges = np.linspace(0, samples, RESIDUAL_BLOCKS + 1).astype(int)[:-1]
    sums = np.add.reduceat((J * residual[..., None]).sum(axis=2), edges, axis=1).reshape(-1, len(C))
    wide = np.maximum(np.diag(C @ S @ C), np.diag(C @ sums.T @ sums @ C))
    factor = np.sqrt(np.maximum(1.0, wide / np.maximum(np.diag(C), 1e-300)))
    return C * np.outer(factor, factor)


def find_colour(problem: Problem, point: Point) -> tuple[Array, bool]:
    """The correlation of neighbouring residuals of each column, and whether any is more than that of white noise."""
    r = point.residual
    count = np.count_nonzero(r, axis=(0, 1))
    with np.errstate(over="ignore", invalid="ignore"):  # of windows that diverge, which are not white
        both = np.sum(r[:, 1:] * r[:, :-1], axis=(0, 1))
        found = both / np.maximum(np.sum(r**2, axis=(0, 1)), 1e-300)
    return found, not np.all(found <= WHITE_DEVIATIONS / np.sqrt(np.maximum(count, 1)))


def name_correlations(paths: list[str], C: Array) -> dict[str, float]:
    """Large correlations by the two paths."""
    error = np.sqrt(np.diag(C))
    found = C / np.outer(error, error) if len(C) else C
    pairs = [(i, j) for i in range(len(paths)) for j in range(i) if abs(found[i, j]) >= NOTED_CORRELATION]
    return {f"{paths[j]}, {paths[i]}": float(found[i, j]) for i, j in pairs}
