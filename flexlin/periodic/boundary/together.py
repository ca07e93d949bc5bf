"""Spectra of many small systems at once: each on the same parts of its own period, by two rules that share neither node nor edge."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.periodic.boundary.spectra import Spectra
from flexlin.periodic.interpolation import NODES, golden, place_edges
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.factors import factor
from flexlin.periodic.transition.gauss import CHUNK_BYTES, gauss, place_nodes
from flexlin.precision import EPS, ROOT_EPS, SAFETY

RULE_STAGES = 5
"""Gauss stages of the rule that shows how wrong the one with a stage more may be."""
SEGMENT_NUMBERS = tuple(NODES // 4 << k for k in range(6))
"""Of a period; systems that miss tol on the first are tried on the next. Interpolants have a point more than the second to the last."""


@dataclass(frozen=True)
class Products:
    """Transition matrices of periods (V, n, n), what is not known of each entry, and the periods (V,) in s."""

    P: Array
    moved: Array
    periods: Array

    @lazy
    def spectra(self) -> Spectra:
        """Logs of the multipliers with their errors."""
        return solve_products(self.P, self.moved)

    def meets(self, tol: float) -> Array:
        """Of which all logs are known to tol, in 1/s or relative beyond, (V,)."""
        logs, errors = self.spectra.logs, self.spectra.errors
        wanted = tol * np.maximum(self.periods[:, None], np.abs(logs))
        return np.asarray((np.isfinite(errors) & (errors <= wanted)).all(axis=1))


def find_together(systems: Sequence[PeriodicSystem], tol: float, phases: Sequence[float] = ()) -> Products:
    """The products of systems of n states, on segments that serve for exponents to tol, where any do.

    Nothing is resolved: what A does between the nodes is seen by the difference of the two rules alone.
    Parameters: phases: of the period at which the systems may jump.
    """
    if len(sizes := {one.n for one in systems}) > 1:
        raise ArgumentError("the systems are not of one size", got=sorted(sizes), expected="as many states in each")
    n, left = systems[0].n, np.arange(len(systems))
    periods = np.array([one.period for one in systems])
    P, moved = np.full((len(left), n, n), np.nan), np.full((len(left), n, n), np.inf)
    for segments in SEGMENT_NUMBERS:
        size = max(1, CHUNK_BYTES // (8 * segments * ((RULE_STAGES + 1) * n) ** 2))
        for part in (left[i : i + size] for i in range(0, len(left), size)):
            P[part], moved[part] = multiply_on([systems[i] for i in part.tolist()], periods[part], segments, phases)
        left = left[~Products(P[left], moved[left], periods[left]).meets(tol)]
        if not len(left):
            break
    return Products(P, moved, periods)


@dataclass(frozen=True)
class Interpolant:
    """The transition matrix of the period as a polynomial in a parameter through Chebyshev's extreme points of a range; its error is that
    of the points and what it misses at points that it does not go through.

    inverse: a polynomial in 1/parameter, as where it is the motion's frequency: then P(T) turns as fast at all periods T.
    """

    low: float
    high: float
    known: Products
    missed: Array
    inverse: bool = False

    @classmethod
    def fit(cls, products_at: Callable[[Array], Products], low: float, high: float, tol: float) -> "Interpolant | None":
        """The interpolant on as few points as serve, none where the most do not of `products_at` values."""
        fewest = SEGMENT_NUMBERS[1] + 1
        between = low + (high - low) * golden(np.arange(1, fewest + 1))
        sure = products_at(between)
        if not sure.meets(tol).all():  # none does where even these do not: growth hides the other multipliers
            return None
        scaled = sure.periods * between
        inverse = bool(low > 0 and np.ptp(scaled) < ROOT_EPS * scaled[0])
        missed = np.zeros(sure.P.shape[1:])
        known = products_at(cls.place(low, high, fewest, inverse))
        while True:
            found = cls(low, high, known, missed, inverse)
            here = found.at(between)
            found = replace(found, missed=SAFETY * np.abs(here.P - sure.P).max(axis=0))
            if found.at(between).meets(tol).all():
                return found
            count = 2 * len(known.P) - 1
            if count > SEGMENT_NUMBERS[-1] + 1:
                return None
            more = products_at(cls.place(low, high, count, inverse)[1::2])
            both, every = ((one.P, one.moved, one.periods) for one in (known, more)), np.arange(1, len(known.P))
            P, moved, periods = (np.insert(even, every, odd, axis=0) for even, odd in zip(*both, strict=True))
            known = Products(P, moved, periods)

    @staticmethod
    def place(low: float, high: float, count: int, inverse: bool) -> Array:
        """Chebyshev's extreme points, every other one of which are those of half the degree."""
        share = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
        return 1 / (1 / low + (1 / high - 1 / low) * share) if inverse else low + (high - low) * share

    def at(self, values: Array) -> Products:
        """Products at values (V,). Source: Berrut, Trefethen, Barycentric Lagrange interpolation, SIAM Rev. 46 (2004) 501."""
        points = self.place(self.low, self.high, len(self.known.P), self.inverse)
        if self.inverse:
            points, values = 1 / points, 1 / values
        weights = (-1.0) ** np.arange(len(points))
        weights[[0, -1]] /= 2
        gaps = values[:, None] - points
        on = gaps == 0
        lagrange = weights / np.where(on, 1.0, gaps)
        lagrange = np.where(on.any(axis=1, keepdims=True), on, lagrange / lagrange.sum(axis=1, keepdims=True))
        moved = np.tensordot(np.abs(lagrange), self.known.moved, 1) + self.missed
        return Products(np.tensordot(lagrange, self.known.P, 1), moved, lagrange @ self.known.periods)


def multiply_on(
    systems: Sequence[PeriodicSystem], periods: Array, segments: int, phases: Sequence[float]
) -> tuple[Array, Array]:
    """Transition matrices of the periods (V, n, n), and what is not known of each entry; inf where there is none."""
    count, n = len(systems), systems[0].n
    even = place_edges(1.0, phases, segments)
    shifted = even[:-1] + (3 - np.sqrt(5)) / 2 * np.diff(even)
    corners = np.array([0.0, *phases, 1.0])
    grids = np.union1d(corners, shifted), even  # where an unnamed jump seems to lie for one rule, it does for no other
    rules = gauss(RULE_STAGES), gauss(RULE_STAGES + 1)
    second = [one.second_order for one in systems]
    given = [one.stacked for one in second if one is not None]
    functions = given if len(given) == count else [one.A for one in systems]
    products = []
    for grid, rule in zip(grids, rules, strict=True):
        times = place_nodes(grid, rule.c)
        sampled = np.array([A(one.period * times.ravel()) for A, one in zip(functions, systems, strict=True)])
        values = sampled.reshape(count * len(times), len(rule.c), *sampled.shape[2:])
        with np.errstate(over="ignore", invalid="ignore"):
            factors = factor(values, (periods[:, None] * np.diff(grid)).ravel(), rule)
            products.append(multiply_up(factors.reshape(count, len(times), n, n)))
    (coarse, _), (P, rounding) = products
    return P, np.where(np.isfinite(P) & np.isfinite(coarse), np.abs(P - coarse) + rounding, np.inf)


def solve_products(P: Array, moved: Array) -> Spectra:
    """Logs of the multipliers (V, n) and bounds on their errors, inf where there is none.

    The bound on an eigenvalue of P + dP is the smaller one of Gershgorin's, sum_j |X^-1 dP X|_ij, and of Elsner's,
    (|P| + |P + dP|)^(1 - 1/n) |dP|^(1/n), which holds where eigenvalues meet.
    Source: Stewart, Sun, Matrix Perturbation Theory (1990), IV.1 and IV.2.
    """
    n, known = P.shape[-1], np.isfinite(moved).all(axis=(1, 2))
    logs, errors = np.full(P.shape[:2], np.nan + 0j), np.full(P.shape[:2], np.inf)
    P, moved = P[known], moved[known]
    values, X = np.linalg.eig(P)
    with np.errstate(all="ignore"):
        regular = np.linalg.cond(X) < 1 / EPS
        back = np.linalg.inv(np.where(regular[:, None, None], X, np.eye(n)))
        near = np.where(regular[:, None], (np.abs(back) @ moved @ np.abs(X)).sum(axis=2), np.inf)
        size, apart = np.linalg.norm(P, axis=(1, 2)), np.linalg.norm(moved, axis=(1, 2))
        met = (2 * size + apart) ** (1 - 1 / n) * apart ** (1 / n)
        share = np.minimum(near, met[:, None]) / np.abs(values)
        logs[known] = np.log(values.astype(complex))
        errors[known] = np.where(share < 0.5, -np.log1p(-np.minimum(share, 0.5)), np.inf)
    return Spectra(logs, errors)


def multiply_up(factors: Array) -> tuple[Array, Array]:
    """F_(K-1) ... F_0 of factors (V, K, n, n), and 4 standard deviations of its rounding, taken as random, for each entry.

    Source: Higham, Mary, A new approach to probabilistic rounding error analysis, SIAM J. Sci. Comput. 41 (2019) A2815.
    """
    n = factors.shape[-1]
    variance = (2 * n * EPS * factors) ** 2
    while factors.shape[1] > 1:
        pairs = factors.shape[1] // 2 * 2
        first, second, size = slice(0, pairs, 2), slice(1, pairs, 2), factors**2
        product = factors[:, second] @ factors[:, first]
        moved = variance[:, second] @ size[:, first] + size[:, second] @ (variance + EPS**2 * size)[:, first]
        factors = np.concatenate([product, factors[:, pairs:]], axis=1)
        variance = np.concatenate([moved, variance[:, pairs:]], axis=1)
    return factors[:, 0], 4 * np.sqrt(variance[:, 0])
