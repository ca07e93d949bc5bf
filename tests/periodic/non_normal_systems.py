"""Non-normal systems: eigenvalues that move by far more than roundings. The truth is that of the doubles given to the engine."""

import numpy as np

from tests.periodic.cases import kind, known, tol_of
from tests.periodic.chains import TWO_PI, Chain, Clock, Real, Rotation
from tests.periodic.jumping_systems import steady, switched, with_breaks
from tests.periodic.transformed_systems import planes, smooth_clock, wave
from tests.periodic.truths import eigenvalues, perturbed_eigenvalues


def triangular(rng, n, largest=6.0):
    """Integers: off-diagonals 30 to 10^largest, distinct eigenvalues on the diagonal, mostly stable."""
    diagonal = -(1.0 + np.arange(n))
    if rng.random() >= 0.5:
        diagonal = rng.permutation(np.arange(-n, 2))[:n] - float(rng.random() < 0.7)
    size = np.round(10 ** rng.uniform(np.log10(30), largest, (n, n)))
    return np.diag(diagonal) + np.triu(size * rng.choice([-1.0, 1.0], (n, n)), 1)


def hidden(rng, U):
    """H U H with a Householder matrix of halves (exact), or Q U Q^T with a random rotation (rounded)."""
    n = len(U)
    if rng.random() < 0.5:
        Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
        return Q @ U @ Q.T
    used = 4 if n >= 4 else 2
    v = np.zeros(n)
    v[rng.permutation(n)[:used]] = rng.choice([-1.0, 1.0], used)
    H = np.eye(n) - 2 * np.outer(v, v) / used
    return H @ U @ H


@kind("non-normal constant", 1000)
def non_normal_constant(rng):
    matrix = hidden(rng, triangular(rng, int(rng.integers(3, 7))))
    return known(steady(matrix), float(10 ** rng.uniform(0, 2)), eigenvalues(matrix), tol_of(rng))


def reference_non_normal(tol=1e-9):
    """H (4000 strictly upper - diag(1, 2, 3, 4)) H, exact in binary: eigenvalues -1 to -4."""
    H = np.eye(4) - 0.5
    matrix = H @ (np.triu(np.full((4, 4), 4000.0), 1) - np.diag([1.0, 2, 3, 4])) @ H
    return known(steady(matrix), 100.0, [-1, -2, -3, -4], tol)


@kind("non-normal, f(t) C", 300)
def non_normal_scaled(rng):
    """Entries of C have 10 bits and f has 40: every product is exact, so the exponents are mean(f) eig(C)."""
    n, period = int(rng.integers(3, 7)), float(10 ** rng.uniform(0, 1.5))
    diagonal, order = -(1.0 + np.arange(n)), rng.permutation(n)
    C = (np.diag(diagonal) + np.triu(rng.integers(30, 1000, (n, n)), 1))[np.ix_(order, order)]
    clock = smooth_clock(rng, period)

    def A(t):
        f = (clock(t)[1] * Real(period) / TWO_PI).astype(float)
        return (np.round(f * 2.0**38) / 2.0**38)[:, None, None] * C

    return known(A, period, diagonal, tol_of(rng), 2.0**-39 * np.abs(diagonal))


@kind("non-normal rotated", 400)
def non_normal_rotated(rng):
    n, period = int(rng.integers(3, 7)), float(10 ** rng.uniform(0, 2))
    U = triangular(rng, n, largest=3.5)
    factors = tuple(Rotation(*planes(rng, n), wave(rng, 0.5, turns=True)) for _ in range(n))
    A = Chain(U, factors, Clock(period))
    exponents, doubt = perturbed_eigenvalues(U, A.rounding(rng), rng)
    return known(A, period, exponents, tol_of(rng), doubt)


@kind("non-normal switched", 300)
def non_normal_switched(rng):
    n, pieces = int(rng.integers(3, 6)), int(rng.integers(2, 4))
    matrices = [hidden(rng, triangular(rng, n, largest=3.0)) for _ in range(pieces)]
    return with_breaks(switched(rng, matrices, float(10 ** rng.uniform(-0.5, 0.5))))
