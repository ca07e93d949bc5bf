"""Modes of any beam and shaft as combinations of polynomials, or of cubic finite elements."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre, polynomial
from scipy.linalg import eigh, solve_triangular

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.mechanics.beam.integrals import UNIFORM, Profile, Shapes, panels, shape_integrals


class Polynomials(Shapes):
    """The basis phi_k'' = sqrt(2k + 1) P_k(2 xi - 1), phi_k(0) = phi_k'(0) = 0: orthonormal in bending on a uniform beam.

    Of twist it is Phi_k' = sqrt(2k + 1) P_k(2 xi - 1), Phi_k(0) = 0, orthonormal on a uniform shaft, and Phi itself turns the section.
    """

    def __init__(self, n: int, twist: bool = False):
        self.n, self.order, self.below = n, n + 4, 1 if twist else 2

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return phi or its derivative with respect to xi: (N,) -> (n, N)."""
        return legendre_series(self.n, derivative - self.below, xi)

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return the section's rotation, phi' or Phi, or its derivative: (N,) -> (n, N)."""
        return legendre_series(self.n, derivative - 1, xi)


class ShearedPolynomials(Shapes):
    """The polynomials phi, that bend and turn the sections, and Y_k' = sqrt(2k + 1) P_k(2 xi - 1), Y_k(0) = 0, that shear alone."""

    def __init__(self, degree: int):
        self.degree, self.n, self.order = degree, 2 * degree, degree + 4

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return the deflections or their derivative with respect to xi: (N,) -> (n, N)."""
        return np.concatenate([legendre_series(self.degree, derivative - below, xi) for below in (2, 1)])

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return phi' above zeros, or its derivative: (N,) -> (n, N)."""
        bending = legendre_series(self.degree, derivative - 1, xi)
        return np.concatenate([bending, np.zeros_like(bending)])


class HermiteElements(Shapes):
    """The cubic Hermite basis on equal elements, clamped at xi = 0: deflection and slope (times the element's length) at each node."""

    def __init__(self, elements: int):
        self.elements, self.n, self.order = elements, 2 * elements, 4
        self.breaks = tuple((np.arange(1, elements) / elements).tolist())

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return phi or its derivative with respect to xi: (N,) -> (n, N)."""
        place = np.asarray(xi) * self.elements
        element = np.clip(place.astype(int), 0, self.elements - 1)
        cubics = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], dtype=float)
        local = polynomial.polyval(place - element, polynomial.polyder(cubics, derivative, axis=1).T)
        whole = np.zeros((self.n + 2, len(place)))
        whole[2 * element + np.arange(4)[:, None], np.arange(len(place))] = local
        return whole[2:] * float(self.elements) ** derivative


def legendre_series(n: int, derivative: int, xi: Array) -> Array:
    """Return sqrt(2k + 1) P_k(2 xi - 1), k < n, differentiated (or, if negative, integrated from 0) in xi: (n, N)."""
    if not n:
        return np.zeros((0, len(xi)))
    series = legendre_coefficients(n, derivative)
    return np.asarray(series.T @ legendre.legvander(2 * np.asarray(xi) - 1, len(series) - 1).T)


@lru_cache(maxsize=64)
def legendre_coefficients(n: int, derivative: int) -> Array:
    """Their coefficients by P_0, P_1 ..., one column each, kept: finding them costs more than using them."""
    unit, down, up = np.diag(np.sqrt(2 * np.arange(n) + 1.0)), max(-derivative, 0), max(derivative, 0)
    return np.asarray(legendre.legder(legendre.legint(unit, down, lbnd=-1, scl=0.5), up, scl=2.0))


@dataclass(frozen=True)
class Ends:
    """Rigid bodies on a beam's ends, relative to rhoA l and rhoA l^3; `hub_inertia` turns with a pinned base."""

    mass: float = 0.0
    inertia: float = 0.0
    hub_inertia: float = 0.0


@dataclass(frozen=True)
class Section:
    """What a section of some height adds: shear stiffness kappa G A l^2 / EI (None: it does not shear), radius of gyration / l."""

    shear: float | None = None
    gyration: float = 0.0


class ReducedShapes(Shapes):
    """X = coefficients phi - turn xi: modes in a clamped basis phi, turned back by the rigid rotation where the base is pinned."""

    def __init__(self, beta: Array, basis: Shapes, coefficients: Array, turn: Array):
        self.beta, self.basis, self.coefficients, self.turn = beta, basis, coefficients, turn
        self.n, self.order, self.breaks = len(beta), basis.order, basis.breaks

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return X or its derivative with respect to xi: (N,) -> (n, N)."""
        rigid = (np.asarray(xi), np.ones_like(xi), np.zeros_like(xi), np.zeros_like(xi))[derivative]
        return self.coefficients @ self.basis.values(xi, derivative) - np.multiply.outer(self.turn, rigid)

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return the section's rotation psi or its derivative: (N,) -> (n, N)."""
        rigid = np.ones_like(xi) if derivative == 0 else np.zeros_like(xi)
        return self.coefficients @ self.basis.rotation(xi, derivative) - np.multiply.outer(self.turn, rigid)


def bending_shapes(
    n: int,
    mu: Profile = UNIFORM,
    eps: Profile = UNIFORM,
    ends: Ends = Ends(),
    pinned: bool = False,
    section: Section = Section(),
    elements: int | None = None,
) -> ReducedShapes:
    """Return the n lowest modes of a beam, by Ritz's method on polynomials of degree 2 n + 25, or on cubic Hermite elements.

        d^2/dxi^2 (eps X'') = beta^4 mu X,   int mu X^2 = 1,      or Timoshenko's equations of X and psi with a `section`

    K c = beta^4 M c with K = R^T R and M = L L^T, the columns of L at Gauss nodes: beta^-2 are the singular values of R^-T L. M is not
    formed, so fast modes keep their digits too: 1e-14 with 10 of a uniform beam, 1e-12 with 60. For a pinned base the rigid rotation
    is taken out by mass-orthogonality. Assumes profiles smooth enough: the error falls algebraically past a kink; with elements it falls
    with the fourth power of their length.

    Parameters: mass mu and stiffness eps relative to the link's own; bodies on its ends; whether the base is pinned, else it is clamped;
    elements: how many of equal length, or none for polynomials.
    Raises: ArgumentError when there are fewer functions than modes.
    Source: Ritz (1909); Meirovitch, Analytical Methods in Vibrations (1967), section 6.5; Przemieniecki (1968), section 11.3.
    """
    basis: Shapes = Polynomials(2 * n + 24) if section.shear is None else ShearedPolynomials(2 * n + 24)
    if elements is not None:
        basis = HermiteElements(elements)
    if basis.n < n:
        raise ArgumentError("too few elements", got=elements, expected=f"at least {(n + 1) // 2} for {n} modes")
    xi, weight = panels(np.unique([0.0, *basis.breaks, *mu.breaks, *eps.breaks, 1.0]), basis.order + 8)
    load, second, tip = np.sqrt(weight * mu(xi)), np.sqrt(weight * eps(xi)), np.ones(1)
    moved = [  # the roots of what the masses are multiplied by in the kinetic energy, beside those of the rigid rotation
        (basis.values(xi) * load, xi * load),
        (basis.values(tip) * np.sqrt(ends.mass), tip * np.sqrt(ends.mass)),
        (basis.rotation(tip) * np.sqrt(ends.inertia), tip * np.sqrt(ends.inertia)),
        (basis.rotation(xi) * section.gyration * second, section.gyration * second),
        (np.zeros((basis.n, 1)), tip * np.sqrt(ends.hub_inertia)),
    ]
    L, rigid = (np.concatenate(parts, axis=-1) for parts in zip(*moved, strict=True))
    turn = L @ rigid / (rigid @ rigid) if pinned else np.zeros(basis.n)
    L = L - np.outer(turn, rigid)
    sheared = basis.values(xi, 1) - basis.rotation(xi)
    strained = np.concatenate([basis.rotation(xi, 1) * second, np.sqrt(section.shear or 0.0) * sheared * load], axis=1)
    R = np.linalg.qr(strained.T, mode="r")
    vectors, values, _ = np.linalg.svd(solve_triangular(R, L, trans="T"), full_matrices=False)
    c = solve_triangular(R, vectors[:, :n]).T
    return combine(basis, values[:n] ** -0.5, c, c @ L[:, : len(xi)], turn, pinned)


def combine(basis: Shapes, beta: Array, c: Array, own: Array, turn: Array, pinned: bool = False) -> ReducedShapes:
    """Shapes of coefficients c, scaled to rows of length 1 in `own`, with a positive curvature at the base, or slope where it is pinned.

    A hub bends the base against its slope, psi' = -J beta^4 psi: where it is heavy, so that the slope is rounding, the curvature says it.
    """
    c = c / np.linalg.norm(own, axis=1)[:, None]
    shapes = ReducedShapes(beta, basis, c, c @ turn)
    slope, curvature = (shapes.rotation(np.zeros(1), k) for k in (0, 1))
    c = np.where((slope - curvature if pinned else curvature) < 0, -c, c)
    return ReducedShapes(beta, basis, c, c @ turn)


def twisted(n: int, eps: Profile, tip_inertia: float) -> ReducedShapes:
    """Return n shapes of twist: modes of a clamped shaft within the polynomials of degree n.

        (eps Phi')' + beta^4 eps Phi = 0,   Phi'(1) = beta^4 tip_inertia Phi(1),   int eps Phi^2 = 1

    The polynomials are complete at the tip too, so a disc that the shapes are not made for costs no accuracy: the error falls
    exponentially with n. Assumes GJ and the polar inertia to vary alike.

    Parameters: tip_inertia relative to the shaft's own, rho I_p l.
    Source: Ritz (1909).
    """
    basis = Polynomials(n, twist=True)
    k = shape_integrals(basis, UNIFORM, eps)
    squares, vectors = eigh(k.bending, k.rotations + tip_inertia * np.outer(k.tip_slope, k.tip_slope))
    own = vectors.T @ np.linalg.cholesky(k.rotations)
    return combine(basis, np.maximum(squares, 0.0) ** 0.25, vectors.T, own, np.zeros(n))
