"""Spectra of many small systems at once: each on the same parts of its own period, by two rules that share neither node nor edge."""

from collections.abc import Callable, Sequence

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.spectra import Spectra
from flexlin.periodic.precision import EPS
from flexlin.periodic.resolved.panels import NODES
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import CHUNK_BYTES, collocate, collocate_accelerations, gauss, place_nodes

STAGES = 4
"""Gauss stages of the rule that shows how wrong the one with a stage more may be."""
SEGMENTS = (NODES // STAGES, NODES, NODES * STAGES)
"""Of a period; systems that miss tol on the first are tried on the next."""


def find_together(systems: Sequence[PeriodicSystem], tol: float) -> tuple[Spectra, Array]:
    """Spectra of systems without jumps, all of n states, and which of them meet tol, in 1/s or relative beyond, (V,).

    Nothing is resolved: what A does between the nodes is seen by the difference of the two rules alone.
    """
    n, left = systems[0].n, np.arange(len(systems))
    logs, errors = np.full((len(left), n), np.nan + 0j), np.full((len(left), n), np.inf)
    periods = np.array([one.period for one in systems])
    for segments in SEGMENTS:
        size = max(1, CHUNK_BYTES // (8 * segments * ((STAGES + 1) * n) ** 2))
        for part in (left[i : i + size] for i in range(0, len(left), size)):
            logs[part], errors[part] = solve_on([systems[i] for i in part.tolist()], periods[part], segments)
        wanted = tol * np.maximum(periods[left, None], np.abs(logs[left]))
        left = left[~(np.isfinite(errors[left]) & (errors[left] <= wanted)).all(axis=1)]
    return Spectra(logs, errors), ~np.isin(np.arange(len(systems)), left)


def solve_on(systems: Sequence[PeriodicSystem], periods: Array, segments: int) -> tuple[Array, Array]:
    """Logs of the multipliers (V, n) and bounds on their errors, inf where there is none.

    The bound on an eigenvalue of P + dP is the smaller one of Gershgorin's, sum_j |X^-1 dP X|_ij, and of Elsner's,
    (|P| + |P + dP|)^(1 - 1/n) |dP|^(1/n), which holds where eigenvalues meet.
    Source: Stewart, Sun, Matrix Perturbation Theory (1990), IV.1 and IV.2.
    """
    count, n = len(systems), systems[0].n
    even = np.linspace(0.0, 1.0, segments + 1)
    shifted = (
        even[:-1] + (3 - np.sqrt(5)) / 2 / segments
    )  # where a jump seems to lie for one rule, it does for no other
    grids = np.concatenate([even[:1], shifted, even[-1:]]), even
    rules = gauss(STAGES), gauss(STAGES + 1)
    shares = [place_nodes(grid, rule.c).ravel() for grid, rule in zip(grids, rules, strict=True)]
    times, twice = np.concatenate(shares), all(one.second_order is not None for one in systems)
    sampled = [sample_either(one, one.period * times, twice) for one in systems]
    factor: Callable[..., Array] = collocate_accelerations if twice else collocate
    products = []
    with np.errstate(over="ignore", invalid="ignore"):
        for grid, rule, first in zip(grids, rules, (0, len(shares[0])), strict=True):
            segments, stages = len(grid) - 1, len(rule.c)
            parts = [np.array(part)[:, first : first + segments * stages] for part in zip(*sampled, strict=True)]
            parts = [part.reshape(count, segments, stages, *part.shape[2:]) for part in parts]
            lengths = periods[:, None] * np.diff(grid)
            products.append(multiply_up(factor(*parts, lengths, rule)))
    (coarse, _), (P, rounding) = products
    known = (
        np.isfinite(P).all(axis=(1, 2)) & np.isfinite(coarse).all(axis=(1, 2)) & np.isfinite(rounding).all(axis=(1, 2))
    )
    logs, errors = np.full((count, n), np.nan + 0j), np.full((count, n), np.inf)
    P, moved = P[known], np.abs(P - coarse)[known] + rounding[known]
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
    return logs, errors


def sample_either(system: PeriodicSystem, t: Array, twice: bool) -> tuple[Array, ...]:
    """M, D and K of a second-order system at times (N,), else A."""
    return system.second_order.sample(t) if twice and system.second_order is not None else (system.A(t),)


def multiply_up(factors: Array) -> tuple[Array, Array]:
    """F_(K-1) ... F_0 of factors (V, K, n, n), and a bound on its rounding, entry by entry."""
    n, size = factors.shape[-1], np.abs(factors)
    rounding = 8 * n * EPS * size
    while factors.shape[1] > 1:
        pairs = factors.shape[1] // 2 * 2
        first, second = slice(0, pairs, 2), slice(1, pairs, 2)
        product, both = factors[:, second] @ factors[:, first], size[:, second] @ size[:, first]
        moved = rounding[:, second] @ size[:, first] + size[:, second] @ rounding[:, first] + n * EPS * both
        factors = np.concatenate([product, factors[:, pairs:]], axis=1)
        rounding = np.concatenate([moved, rounding[:, pairs:]], axis=1)
        size = np.abs(factors)
    return factors[:, 0], rounding[:, 0]
