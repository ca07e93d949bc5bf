"""Floquet exponents by Hill's infinite determinant: harmonic balance, no transition matrix and no product of factors."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array, check_size, whole
from flexlin.periodic.circle import count_turns, measure_distances
from flexlin.periodic.coefficient_series.matrix import couple_uncertainty
from flexlin.periodic.floquet.result import find_reached
from flexlin.periodic.interpolation import NODES, divided
from flexlin.periodic.product import balance_factors
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import count_waves
from flexlin.periodic.transition.gauss import gauss, place_nodes
from flexlin.precision import EPS, FOURTH_ROOT_EPS, PARTIAL, SAFETY

MAX_SIZE = 900
"""Rows of the largest Hill matrix: its eigenvalues take some seconds."""


@dataclass(frozen=True)
class HillSpectrum:
    """Exponents (n,) whose imaginary parts are those of the mean motion (not folded), their errors, and the harmonics kept.

    rounding (n,): rounding's part of the errors; covered: whether both truncations that were compared hold every wave of A.
    """

    exponents: Array
    errors: Array
    harmonics: int
    rounding: Array
    covered: bool


def hill_spectrum(system: PeriodicSystem, tol: float, harmonics: int | None = None) -> HillSpectrum:
    """Compute the exponents of x' = A(t) x from the truncated Hill matrix.

        p' + lambda p = A p,   p = sum_j p_j e^(i j w t):   sum_k A_(j-k) p_k - i j w p_j = lambda p_j

    Every exponent appears as often as harmonics are kept, shifted by i w; the copy is taken whose mean harmonic
    sum_j j |p_j|^2 is nearest zero, and copies of a solution that was taken already are left out. Harmonics are doubled
    until the exponents stay within tol, beginning with twice those of A. At jumps of A convergence is algebraic, which the errors show.

    Raises: ArgumentError unless harmonics is a whole number from 1 on; TooLarge.
    Source: Hill (1886); sorting by the mean harmonic after Lazarus, Thomas, C. R. Mecanique 338 (2010).
    """
    n, panels = system.n, np.diff(system.resolved.edges)
    # two nodes of a panel's polynomials make a wave
    highest = count_waves(system.resolved.series, 0.01 * tol) / (2 if len(panels) > 1 else 1)
    waves = int(np.ceil((highest * system.period / panels).max()))
    # so that half of them hold A too, as far as its size allows
    twice = max(8, min(2 * waves, (MAX_SIZE // n - 1) // 2))
    count = twice if harmonics is None else whole("harmonics", harmonics)
    rows = n * (2 * count + 1)
    held = 5 * 16 * rows**2  # the matrix, its eigenvectors on both sides, and work, all complex
    check_size(f"Hill's matrix with {rows} rows", held, "keep fewer harmonics")
    coarse = truncate_hill(system, max(1, count // 2))
    fine = truncate_hill(system, count)
    while True:
        moved = measure_distances(fine[0] * system.period, coarse[0] * system.period).min(axis=1) / system.period
        errors = 2 * moved + fine[1]
        reached = np.all(find_reached(fine[0], errors, tol) | (errors <= 2 * fine[1]))
        if reached or harmonics is not None or n * (4 * count + 1) > MAX_SIZE:
            return HillSpectrum(fine[0], errors, count, fine[1], waves <= count // 2)
        count *= 2
        coarse, fine = fine, truncate_hill(system, count)


def truncate_hill(system: PeriodicSystem, harmonics: int) -> tuple[Array, Array]:
    """Exponents (n,) from harmonics -N ... N, and what rounding and the error of A's series do to each, by its condition."""
    from scipy.linalg import eig  # takes longer to load than most matrices to solve

    n, w = system.n, 2 * np.pi / system.period
    t = system.period * np.arange(NODES) / NODES
    scale = balance_factors(system.resolved(t))[1]  # rows and columns of A are made alike in size
    left, right = (np.broadcast_to(np.diag(one), (NODES, n, n)) for one in (1 / scale, scale))
    unknown = float(np.linalg.norm(couple_uncertainty(system.resolved, t, left, right), 2, axis=(1, 2)).max())
    H = assemble_hill(expand_fourier(system, 2 * harmonics) * (scale / scale[:, None]), w)
    values, left, right = eig(H, left=True, right=True)
    right, left = right / np.linalg.norm(right, axis=0), left / np.linalg.norm(left, axis=0)
    modes = right.reshape(2 * harmonics + 1, n, -1)
    taken = choose_copies(values, modes, w)
    angle = np.maximum(np.abs((left[:, taken].conj() * right[:, taken]).sum(axis=0)), 1e-300)
    size = np.linalg.norm(H, 2)
    noise = SAFETY * EPS * size + unknown
    return values[taken], np.minimum(noise / angle, np.sqrt(noise * size))


def expand_fourier(system: PeriodicSystem, count: int) -> Array:
    """A_k, k = -count ... count, of A: trapezoidal rule, or Gauss quadrature of each panel of the resolved A."""
    T, resolved = system.period, system.resolved
    if resolved.panels > 1:
        edges, rule = divided(resolved.edges, 2 * T / count), gauss(NODES)  # the fastest wave turns twice between them
        t, weight = place_nodes(edges, rule.c).ravel(), (np.diff(edges)[:, None] / T * rule.b).ravel()
    else:
        points = 4 * count + 2 * resolved.degree + 2
        t, weight = T * np.arange(points) / points, np.full(points, 1 / points)
    k = np.arange(-count, count + 1)
    kernel = weight * np.exp(-2j * np.pi / T * k[:, None] * t)
    return np.einsum("kt,tij->kij", kernel, resolved(t))


def assemble_hill(coefficients: Array, w: float) -> Array:
    """Blocks A_(j-k) - i j w delta_jk for j, k = -N ... N from coefficients A_(-2N) ... A_(2N)."""
    count, n = (len(coefficients) - 1) // 4, coefficients.shape[1]
    j = np.arange(-count, count + 1)
    blocks = coefficients[j[:, None] - j + 2 * count].transpose(0, 2, 1, 3)
    H = blocks.reshape(len(j) * n, len(j) * n).astype(complex)
    H[np.diag_indices(len(H))] -= 1j * w * np.repeat(j, n)
    return H


def choose_copies(values: Array, modes: Array, w: float) -> list[int]:
    """Indices of n independent solutions among all copies, those with mean harmonic nearest zero first."""
    n, half = modes.shape[1], (len(modes) - 1) // 2
    energy = (np.abs(modes) ** 2).sum(axis=1)
    mean = np.arange(-half, half + 1) @ energy
    taken: list[int] = []
    for i in np.argsort(np.abs(mean), kind="stable"):
        if len(taken) == n:
            break
        if not is_copy(int(i), taken, values, modes, w):
            taken.append(int(i))
    return sorted(taken, key=lambda i: -values[i].real)


def is_copy(i: int, taken: list[int], values: Array, modes: Array, w: float) -> bool:
    """Whether eigenvector i, shifted by whole harmonics, lies in the span of taken ones with the same exponent modulo i w."""
    shift = count_turns((values[taken].imag - values[i].imag) * (2 * np.pi / w)).astype(int)
    apart = np.abs(values[taken] - values[i] - 1j * w * shift)
    span = [
        np.roll(modes[:, :, j], m, axis=0).ravel()
        for j, m, d in zip(taken, shift, apart, strict=True)
        if m != 0 and d < FOURTH_ROOT_EPS * w  # modulo i w
    ]
    if not span:
        return False
    basis = np.linalg.qr(np.column_stack(span))[0]
    vector = modes[:, :, i].ravel()
    return bool(np.linalg.norm(vector - basis @ (basis.conj().T @ vector)) < PARTIAL)
