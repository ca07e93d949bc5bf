"""How far perturbations of the factors move the logs of a product's eigenvalues: first order, and what clusters add."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.product.eigenvectors import eigenvector_chain
from flexlin.periodic.product.schur import PeriodicSchur

EPS = float(np.finfo(float).eps)
FACTOR_ROUNDING = 1.0
"""Roundings of the largest entry that one factor carries: its own computation, and one product and QR step of the spectrum."""

COHERENT = 0.25
"""The part of the rounding errors that may add up with one sign."""
CANCELLED = 0.3
"""The part of the factors' errors that counts even where their sum cancels."""
UNKNOWN = 1e100
"""A bound that says nothing: a number, since infinity stands for what decays too fast to be resolved."""
SAMES = (1e-6, 1e-3, 0.1)
"""Ratios of multipliers that count as equal: wider ones are tried where a perturbation is larger than the gaps."""
ALONE = 0.01
"""An eigenvalue that moves by less than this part of the distance to its neighbour is not part of a block."""
CLOSE = 0.1
"""Couplings above this part of a gap move the pair by about their own size: m multipliers of a split chain have 1 / (2 m sin(pi / m))."""

DOUBTED = 2.0
"""How many times the method's coupling counts where it is asked what has split a pair: better factors err too."""

Couplings = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Motion:
    """Bounds on the motion of each log, (n,): by the method's error, and by rounding; `shift`: the first-order motion with its sign."""

    shift: Array
    method: Array
    rounding: Array


def spectrum_motion(
    form: PeriodicSchur, factors: Array, better: Array, noise: Couplings | None = None, counts: Array | float = 1.0
) -> Motion:
    """Bound how far the logs move when the factors are replaced by better ones, and by rounding.

        d log mu_i = sum_k l_(k+1),i^H dF_k r_k,i / t_k,i        l_i, r_i: left and right eigenvectors along the product

    To second order each pair i, j adds A_ij A_ji / |log mu_i - log mu_j|, A the sums of the couplings in these coordinates, but never
    more than sqrt(A_ij A_ji); equal multipliers that share an eigenvector add Elsner's bound for their block.

    Parameters: form: of `factors` (K, n, n); better: the same factors by a more accurate method;
    noise: left and right vectors at the factors' beginnings (K, n, n) -> bounds on further couplings over each factor (K, n, n), which
    may all have one sign; counts (K,): how many factors were multiplied into each, with a rounding of its own for each.
    Source: Stewart, Sun, Matrix Perturbation Theory (1990), IV.1.3, V.2; for products Benner, Mehrmann, Xu (2002).
    """
    counted = np.broadcast_to(counts, len(factors))[:, None, None]
    motion = motion_at(SAMES[0], form, factors, better, noise, counted)
    apart = measure_distances(form.logs, form.logs) + np.diag(np.full(len(form.logs), np.inf))
    for same in SAMES[1:]:
        if np.all(motion.method + motion.rounding < ALONE * apart.min(axis=1)):
            break
        other = motion_at(same, form, factors, better, noise, counted)
        motion = Motion(
            motion.shift, np.minimum(motion.method, other.method), np.minimum(motion.rounding, other.rounding)
        )
    return motion


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def motion_at(
    same: float, form: PeriodicSchur, factors: Array, better: Array, noise: Couplings | None, counts: Array
) -> Motion:
    """The bounds when multipliers whose ratio is 1 up to `same` are left in one block; UNKNOWN where there are no eigenvectors."""
    try:
        right, left, shared = eigenvector_chain(form, same)
    except np.linalg.LinAlgError:
        unknown = np.full(len(form.logs), UNKNOWN)
        return Motion(np.zeros_like(unknown), unknown, unknown)
    growth = form.diagonal[:, :, None]
    method = left[1:] @ (better - factors) @ right[:-1] / growth
    length_right, length_left = np.linalg.norm(right, axis=1), np.linalg.norm(left, axis=2)
    size = np.linalg.norm(factors, axis=(1, 2))[:, None, None] * FACTOR_ROUNDING * EPS
    rounding = size * length_left[1:, :, None] * length_right[:-1, None, :] / np.abs(growth)
    rounding = np.maximum(np.sqrt((counts * rounding**2).sum(axis=0)), COHERENT * (counts * rounding).sum(axis=0))
    rounding += form.defect * length_left[0][:, None] * length_right[0]
    if noise is not None:
        rounding += noise(left[:-1], right[:-1]).sum(axis=0)
    shift = np.diagonal(method, axis1=1, axis2=2).sum(axis=0)
    gap = measure_distances(form.logs, form.logs)
    couplings = np.abs(method).sum(axis=0)
    by_method = np.maximum(np.abs(shift), CANCELLED * np.diagonal(couplings))
    by_method += bound_pairs(couplings, np.abs(shift), gap, shared, DOUBTED * couplings + rounding)
    by_rounding = (
        np.diagonal(rounding) + bound_pairs(rounding, np.diagonal(rounding), gap, shared) + 4 * EPS * np.abs(form.logs)
    )
    return Motion(known(shift), known(by_method), known(by_rounding))


def known(bound: Array) -> Array:
    """A bound as a number: UNKNOWN where it left the range of numbers."""
    return np.minimum(np.nan_to_num(bound, nan=UNKNOWN), UNKNOWN)


def bound_pairs(coupling: Array, own: Array, gap: Array, shared: Array, whole: Array | None = None) -> Array:
    """What pairs of eigenvalues do to each other beyond first order, (n,).

    Parameters: coupling (n, n): of the perturbation in the eigenvectors' coordinates; own (n,): first-order motions, which may
    close gaps; gap (n, n): distances of the eigenvalues; shared (n, n): couplings left between equal ones; whole (n, n): all that may have
    split a pair, where that is more than the coupling.
    """
    gap = np.maximum(gap - own[:, None] - own, 0.0)
    size = pair_size(coupling)
    splitting = size if whole is None else pair_size(whole)
    pairs = np.where(splitting > CLOSE * gap, 2 * splitting, size**2 / np.maximum(gap, size + np.finfo(float).tiny))
    return pairs.sum(axis=1) + bound_shared(coupling, np.abs(shared))


def pair_size(coupling: Array) -> Array:
    """sqrt(A_ij A_ji) of each pair (n, n), zero on the diagonal."""
    product = coupling * coupling.T
    np.fill_diagonal(product, 0.0)
    return np.asarray(np.sqrt(product))


def bound_shared(coupling: Array, shared: Array) -> Array:
    """Elsner's bound (|N| + |E|)^(1 - 1/m) |E|^(1/m) for each block of m multipliers that N couples; zero elsewhere."""
    bound = np.zeros(len(shared))
    linked = shared + shared.T > 0
    for members in {
        tuple(np.flatnonzero(row | own).tolist())
        for row, own in zip(linked, np.eye(len(shared), dtype=bool), strict=True)
    }:
        if len(members) > 1:
            block, m = np.ix_(members, members), len(members)
            E, N = np.linalg.norm(coupling[block]), np.linalg.norm(shared[block])
            bound[list(members)] = np.maximum(bound[list(members)], (N + E) ** (1 - 1 / m) * E ** (1 / m))
    return bound
