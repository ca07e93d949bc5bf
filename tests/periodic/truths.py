"""Exponents in extended precision: eigenvalues, products of exponentials, and transition matrices on panels, each with its own doubt."""

from functools import lru_cache
from itertools import accumulate, pairwise

import mpmath as mp
import numpy as np

from tests.periodic.chains import Real

STAGES = 12
HALF_ULP = 2.0**-53
PRODUCT = 3e-19
"""Rounding of an entry of a product of extended numbers, relative to its terms."""


def folded(exponents, period):
    """Imaginary parts into (-pi/T, pi/T]."""
    w = 2 * np.pi / period
    return exponents - 1j * w * np.ceil(exponents.imag / w - 0.5)


def apart(found, known, period):
    """Distances (n, m) of exponents found from those that are known, modulo 2 pi i / T."""
    gap, w = np.subtract.outer(found, known), 2 * np.pi / period
    return np.abs(gap - 1j * w * np.round(gap.imag / w))


def eigenvalues(matrix, digits=60):
    """Eigenvalues of a matrix of doubles as it stands."""
    with mp.workdps(digits):
        values = mp.eig(mp.matrix(np.asarray(matrix).tolist()), left=False, right=False)
        return np.array([complex(v) for v in values])


def perturbed_eigenvalues(matrix, entries, rng, trials=3):
    """Eigenvalues, and twice the largest motion of each when every entry moves by its share with a random sign."""
    exact = eigenvalues(matrix)
    doubt = np.zeros(len(exact))
    for _ in range(trials):
        with mp.workdps(60):
            moved = mp.matrix(matrix.tolist()) + mp.matrix((entries * rng.choice([-1.0, 1.0], entries.shape)).tolist())
            other = np.array([complex(v) for v in mp.eig(moved, left=False, right=False)])
        doubt = np.maximum(doubt, 2 * np.abs(exact[:, None] - other).min(axis=1))
    return exact, doubt


def switched_exponents(matrices, edges):
    """log(eig(exp(A_k d_k) ... exp(A_1 d_1))) / T, d = differences of the edges from 0 to T; digits are doubled until nothing changes."""
    digits, before = 60, None
    while digits < 4000:
        now = product_exponents(matrices, edges, digits)
        if before is not None and settled(before, now, edges[-1]):
            return np.array([complex(v) for v in now])
        digits, before = 2 * digits, now
    raise ArithmeticError("the product of exponentials does not settle")


def settled(before, now, period):
    """Whether each exponent has one before within 1e-22 modulo 2 pi i / T, relative beyond 1/s."""
    with mp.workdps(40):
        turn = mp.mpc(0, 2 * mp.pi / mp.mpf(float(period)))
        apart = [[a - b - turn * mp.nint(((a - b) / turn).real) for b in before] for a in now]
        return all(min(map(abs, row)) < 1e-22 * max(1, abs(a)) for a, row in zip(now, apart, strict=True))


def product_exponents(matrices, edges, digits):
    """The same with a number of digits."""
    with mp.workdps(digits):
        product = mp.eye(len(matrices[0]))
        for matrix, (a, b) in zip(matrices, pairwise(mp.mpf(float(e)) for e in edges), strict=True):
            product = mp.expm(mp.matrix(np.asarray(matrix).tolist()) * (b - a)) * product
        values = mp.eig(product, left=False, right=False)
        return [mp.log(v) / mp.mpf(float(edges[-1])) for v in values]


@lru_cache
def gauss_tableau():
    """Gauss-Legendre nodes on [0, 1], the weights, and the matrix of integrals from 0 to each node, in extended precision."""
    with mp.workdps(40):
        nodes = sorted(
            (1 + mp.findroot(lambda x: mp.legendre(STAGES, x), float(x))) / 2
            for x in np.polynomial.legendre.leggauss(STAGES)[0]
        )
        powers = mp.matrix([[x**k for k in range(STAGES)] for x in nodes])
        integrals = mp.matrix([[x ** (k + 1) / (k + 1) for k in range(STAGES)] for x in [*nodes, mp.mpf(1)]])

        def extended(M):
            return np.array([[Real(mp.nstr(M[i, j], 30)) for j in range(M.cols)] for i in range(M.rows)])

        inner = extended(integrals * powers**-1)
        return extended(mp.matrix(nodes))[:, 0], inner[-1], inner[:-1]


def panel_transitions(A, panels):
    """Transition matrices over panels: X_i = I + h sum_j S_ij A_j X_j, iterated (Picard); A takes extended times."""
    nodes, weights, inner = gauss_tableau()
    start, h = panels[:-1], np.diff(panels)
    samples = A((start[:, None] + h[:, None] * nodes).ravel())
    n = samples.shape[-1]
    samples = samples.reshape(len(h), STAGES, n, n) * h[:, None, None, None]
    X = np.broadcast_to(np.eye(n, dtype=Real), samples.shape)
    for _ in range(200):
        slopes = samples @ X
        new = np.eye(n, dtype=Real) + (inner @ slopes.reshape(len(h), STAGES, -1)).reshape(samples.shape)
        change, X = np.abs(new - X).max(), new
        if change <= 1e-18 * np.abs(X).max():
            break
    else:
        raise ArithmeticError("Picard's iteration does not converge: the panels are too long")
    ends = np.eye(n, dtype=Real) + np.einsum("j,kjab->kab", weights, samples @ X)
    return ends, np.abs(samples).mean(axis=1)


def integrated(A, panels, period):
    """Exponents of x' = A x from panels that cover a period, and how far each may be wrong.

    By the first-order effect of relative roundings HALF_ULP of A, and by the truth's own arithmetic.

    The products themselves carry roundings of their entries' sizes: a multiplier that is small beside them is known less well.
    """
    transitions, weight = panel_transitions(A, np.asarray(panels, Real))
    n = transitions.shape[-1]
    before = list(accumulate(transitions, lambda total, step: step @ total, initial=np.eye(n, dtype=Real)))
    after = list(accumulate(transitions[::-1], np.matmul, initial=np.eye(n, dtype=Real)))
    with mp.workdps(40):
        values, left, right = mp.eig(as_mp(before[-1]), left=True, right=True)
        exponents = np.array([complex(mp.log(v) / mp.mpf(period)) for v in values])
        sizes = np.array([float(abs(v)) for v in values])
        y, x = as_complex(left), as_complex(right)
    first = np.abs(np.array(before[1:], float) @ x)  # (panels, n, i)
    last = np.abs(y @ np.array(after[-2::-1], float))  # (panels, i, n)
    rounded = np.einsum("kia,kab,kbi->i", last, HALF_ULP * weight.astype(float), first)
    arithmetic = 1e-18 * np.einsum("kia,kai->i", last, first)
    product = np.abs(np.array(before[1:], float)) @ np.abs(x)
    arithmetic += PRODUCT * np.sqrt((np.einsum("kia,kai->ki", last, product) ** 2).sum(axis=0))
    own = np.abs(np.einsum("ia,ai->i", y, x)) * sizes * period
    return exponents, near_double(exponents, (rounded + arithmetic) / np.maximum(own, 1e-300), period)


def near_double(exponents, doubt, period):
    """Where two exponents are g apart and first order gives d > g / 4: sqrt(delta + d g) with delta = (g / 2)^2 instead."""
    if len(exponents) == 1:
        return doubt
    nearest = (apart(exponents, exponents, period) + np.diag(np.full(len(exponents), np.inf))).min(axis=1)
    root = 2 * np.sqrt(2 * doubt * nearest) + 1e-15 * (1 + np.abs(exponents) + 1 / period)
    return np.where(doubt > nearest / 4, root, doubt)


def as_mp(matrix):
    digits = [[np.format_float_scientific(v, precision=25, unique=False) for v in row] for row in matrix]
    return mp.matrix(digits)


def as_complex(matrix):
    return np.array(matrix.tolist(), complex)


def panels_of(period, rate, corners=(), windows=()):
    """Edges of panels: 64 or more, at most 0.5/rate long, at each corner, and `count` over each window (centre, half-width, count)."""
    edges = [np.linspace(0, period, max(64, int(np.ceil(2 * rate * period))) + 1), np.asarray(corners, float)]
    for centre, half, count in windows:
        inside = np.linspace(centre - half, centre + half, count + 1)
        edges.append(np.mod(inside, period))
    return np.unique(np.concatenate([e[(e >= 0) & (e <= period)] for e in edges]))
