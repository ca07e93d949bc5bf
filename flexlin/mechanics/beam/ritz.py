"""Modes of any beam as combinations of a basis: tapered links by polynomials, or cubic finite elements reduced by modes."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.mechanics.beam.integrals import Profile, ShapeIntegrals, Shapes, shape_integrals


class Polynomials(Shapes):
    """The basis phi_k'' = sqrt(2k + 1) P_k(2 xi - 1), phi_k(0) = phi_k'(0) = 0: orthonormal in bending on a uniform beam."""

    def __init__(self, n: int):
        self.n, self.order = n, n + 4

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return phi or its derivative with respect to xi: (N,) -> (n, N)."""
        return legendre_series(self.n, derivative - 2, xi)


class TwistPolynomials(Polynomials):
    """The basis Phi_k' = sqrt(2k + 1) P_k(2 xi - 1), Phi_k(0) = 0: orthonormal in torsion on a uniform shaft."""

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return Phi or its derivative with respect to xi: (N,) -> (n, N)."""
        return legendre_series(self.n, derivative - 1, xi)

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return the section's rotation, Phi itself, or its derivative: (N,) -> (n, N)."""
        return self.values(xi, derivative)


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
        local = np.polynomial.polynomial.polyval(
            place - element, np.polynomial.polynomial.polyder(cubics, derivative, axis=1).T
        )
        whole = np.zeros((self.n + 2, len(place)))
        whole[2 * element + np.arange(4)[:, None], np.arange(len(place))] = local
        return whole[2:] * float(self.elements) ** derivative


def legendre_series(n: int, derivative: int, xi: Array) -> Array:
    """Return sqrt(2k + 1) P_k(2 xi - 1), k < n, differentiated (or, if negative, integrated from 0) in xi: (n, N)."""
    unit = np.diag(np.sqrt(2 * np.arange(n) + 1.0))
    if not n:
        return np.zeros((0, len(xi)))
    down, up = max(-derivative, 0), max(derivative, 0)
    series = legendre.legder(legendre.legint(unit, down, lbnd=-1, scl=0.5), up, scl=2.0)
    return legendre.legval(2 * np.asarray(xi) - 1, series)


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


def tapered(
    n: int,
    mass: Profile | None = None,
    stiffness: Profile | None = None,
    ends: Ends | None = None,
    base: str = "clamped",
    section: Section | None = None,
) -> ReducedShapes:
    """Return the n lowest modes of a beam with varying section, by Ritz's method on polynomials of degree 2 n + 25.

        d^2/dxi^2 (eps X'') = beta^4 mu X,   int mu X^2 = 1,      or Timoshenko's equations of X and psi with a `section`

    Assumes profiles smooth enough: the error falls exponentially with the degree for smooth ones, algebraically past a kink.

    Parameters: mass mu and stiffness eps relative to the link's own; bodies on its ends; base "clamped" or "pinned".
    Raises: ArgumentError for an unknown base.
    Source: Ritz (1909); Meirovitch, Analytical Methods in Vibrations (1967), section 6.5.
    """
    section = section or Section()
    basis = Polynomials(2 * n + 24) if section.shear is None else ShearedPolynomials(2 * n + 24)
    return reduce_by_modes(n, basis, mass, stiffness, ends or Ends(), base, section)


def finite_elements(
    n: int,
    elements: int = 40,
    mass: Profile | None = None,
    stiffness: Profile | None = None,
    ends: Ends | None = None,
    base: str = "clamped",
) -> ReducedShapes:
    """Return the n lowest modes of a beam of cubic Hermite elements; frequencies converge with the fourth power of the element's length.

    Parameters: elements of equal length; the others as in `tapered`.
    Raises: ArgumentError when there are fewer functions than modes, or for an unknown base.
    Source: Przemieniecki, Theory of Matrix Structural Analysis (1968), section 11.3.
    """
    if 2 * elements < n:
        raise ArgumentError("too few elements", got=elements, expected=f"at least {(n + 1) // 2} for {n} modes")
    return reduce_by_modes(n, HermiteElements(elements), mass, stiffness, ends or Ends(), base, Section())


def reduce_by_modes(
    n: int, basis: Shapes, mass: Profile | None, stiffness: Profile | None, ends: Ends, base: str, section: Section
) -> ReducedShapes:
    """Solve K c = beta^4 M c in a clamped basis; for a pinned base the rigid rotation is taken out by mass-orthogonality."""
    if base not in ("clamped", "pinned"):
        raise ArgumentError("there is no such base", got=repr(base), expected="'clamped' or 'pinned'")
    k = shape_integrals(basis, mass, stiffness)
    M, coupling, rotation = mass_products(k, ends, section.gyration)
    turn = coupling / rotation if base == "pinned" else np.zeros(basis.n)
    M = M - np.outer(turn, turn) * rotation
    # flexibilities: the large ones are the slow modes and keep their digits, though M may be singular
    flexibility, vectors = eigh(M, k.bending + (section.shear or 0.0) * k.shear)
    c = vectors[:, ::-1][:, :n].T
    own = k.gram - np.outer(turn, k.mode_moment) - np.outer(k.mode_moment, turn) + k.second * np.outer(turn, turn)
    return combine(basis, flexibility[::-1][:n] ** -0.25, c, own, turn, 0 if base == "pinned" else 1)


def combine(basis: Shapes, beta: Array, c: Array, own: Array, turn: Array, derivative: int) -> ReducedShapes:
    """Shapes of coefficients c, scaled to c own c = 1 and a positive rotation, or derivative of it, at the base."""
    c = c / np.sqrt(np.diag(c @ own @ c.T))[:, None]
    start = ReducedShapes(beta, basis, c, c @ turn).rotation(np.zeros(1), derivative)
    c = np.where(start < 0, -c, c)
    return ReducedShapes(beta, basis, c, c @ turn)


def mass_products(k: ShapeIntegrals, ends: Ends, gyration: float) -> tuple[Array, Array, float]:
    """Products in the whole mass, ends included: of the basis with itself, with the rotation xi, and of xi with itself."""
    basis = k.gram + ends.mass * np.outer(k.tip, k.tip)
    basis = basis + ends.inertia * np.outer(k.tip_slope, k.tip_slope) + gyration**2 * k.rotations
    coupling = k.mode_moment + ends.mass * k.tip + ends.inertia * k.tip_slope
    rigid = k.second + ends.mass + ends.inertia + ends.hub_inertia
    return basis, coupling + gyration**2 * k.rotation, rigid + gyration**2 * k.section


def twisted(n: int, stiffness: Profile | None = None, tip_inertia: float = 0.0) -> ReducedShapes:
    """Return n shapes of twist: modes of a clamped shaft within the polynomials of degree n.

        (eps Phi')' + beta^4 eps Phi = 0,   Phi'(1) = beta^4 tip_inertia Phi(1),   int eps Phi^2 = 1

    The polynomials are complete at the tip too, so a disc that the shapes are not made for costs no accuracy: the error falls
    exponentially with n. Assumes GJ and the polar inertia to vary alike.

    Parameters: tip_inertia relative to the shaft's own, rho I_p l.
    Source: Ritz (1909).
    """
    basis = TwistPolynomials(n)
    k = shape_integrals(basis, None, stiffness)
    squares, vectors = eigh(k.bending, k.rotations + tip_inertia * np.outer(k.tip_slope, k.tip_slope))
    return combine(basis, np.maximum(squares, 0.0) ** 0.25, vectors.T, k.rotations, np.zeros(n), 1)
