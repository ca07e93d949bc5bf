"""From the Hamiltonian of a linear-quadratic problem to segments in scattering form, by collocation or by Magnus' exponential."""

from math import factorial

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.scattering import Segment, scatter_hamiltonian, star_product
from flexlin.periodic.transition.gauss import collect_chunks, collocate, gauss, place_nodes, sample_at
from flexlin.periodic.transition.magnus import average_sixth

PADE = 8
AT_ONCE = 512
"""Segments that are exponentiated at a time: a dozen matrices of each are in memory."""
PADE_REACH = 2.0
"""Size of a matrix up to which the [8/8] Pade approximation of its exponential is exact to 3e-17."""


def gauss_segments(problem: LinearQuadratic, marks: Array, stages: int) -> tuple[Segment, float]:
    """Collocate the Hamiltonian system between consecutive marks: order 2 stages, exactly symplectic.

    Returns: segments (K, n, n) and the relative asymmetry of their costs before it was removed.
    """
    rule, h = gauss(stages), np.diff(marks)

    def part(t: Array, k: slice) -> Array:
        return collocate(sample_at(problem.hamiltonian, t), h[k], rule)

    return scatter_hamiltonian(collect_chunks(part, marks, rule))


def magnus_segments(problem: LinearQuadratic, marks: Array) -> tuple[Segment, float]:
    """Exponentiate Magnus' sixth-order average of the Hamiltonian, however large h |H| is.

        exp(O) = exp(O / 2^k)^(2^k): a Pade approximation of exp(O / 2^k), then k doublings by the star product

    Exact where the coefficients are constant, so segments need to follow the motion only and not the fastest eigenvalue. The
    exponential itself would overflow or lose the slow modes; its scattering form does not.

    Returns: segments (K, n, n) and the relative asymmetry of their costs before it was removed.
    Source: Blanes, Casas, Oteo, Ros, Phys. Rep. 470 (2009) 151, section 5.4.3; Higham, Functions of Matrices (2008), ch. 10.
    """
    t, h = place_nodes(marks, gauss(3).c), np.diff(marks)[:, None, None]
    done = []
    for i in range(0, len(t), AT_ONCE):
        at_nodes = np.moveaxis(sample_at(problem.hamiltonian, t[i : i + AT_ONCE]), 1, 0)
        done.append(scatter_exponentials(average_sixth(at_nodes, h[i : i + AT_ONCE])))
    F, G, H = (np.concatenate([getattr(segments, name) for segments, _ in done]) for name in ("F", "G", "H"))
    return Segment(F, G, H), max(asymmetry for _, asymmetry in done)


def scatter_exponentials(averages: Array) -> tuple[Segment, float]:
    """Exponentiate Hamiltonian matrices (K, 2 n, 2 n) in scattering form: segments and the relative asymmetry of their costs."""
    square = averages @ averages
    size = np.linalg.norm(square @ square, 1, axis=(1, 2)).max() ** 0.25
    doublings = int(max(0, np.ceil(np.log2(max(size, 1e-300) / PADE_REACH))))
    segments, asymmetry = scatter_hamiltonian(approximate_exponential(averages / 2**doublings))
    for _ in range(doublings):
        segments = star_product(segments, segments)
    return segments, asymmetry


def approximate_exponential(A: Array) -> Array:
    """Return the diagonal Pade approximation of exp(A) for a stack of matrices: symplectic where A is Hamiltonian."""
    weights = [
        factorial(2 * PADE - j) * factorial(PADE) / (factorial(2 * PADE) * factorial(j) * factorial(PADE - j))
        for j in range(PADE + 1)
    ]
    square = A @ A
    power = np.broadcast_to(np.eye(A.shape[-1]), A.shape)
    even, odd = np.zeros_like(A), np.zeros_like(A)
    for j in range(0, PADE + 1, 2):
        even = even + weights[j] * power
        if j < PADE:
            odd = odd + weights[j + 1] * power
            power = power @ square
    odd = A @ odd
    return np.linalg.solve(even - odd, even + odd)
