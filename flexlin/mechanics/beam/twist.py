"""Shapes of a shaft that is clamped at its base and twisted, its tip free or carrying a body."""

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from flexlin.checks import Array
from flexlin.mechanics.beam.bases import Polynomials, legendre_series
from flexlin.mechanics.beam.integrals import shape_integrals
from flexlin.mechanics.beam.profile import Profile
from flexlin.mechanics.beam.ritz import ReducedShapes


class TwistPolynomials(Polynomials):
    """The basis Phi_k' = sqrt(2k + 1) P_k(2 xi - 1), Phi_k(0) = 0: orthonormal in torsion on a uniform shaft."""

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return Phi or its derivative with respect to xi: (N,) -> (n, N)."""
        return legendre_series(self.n, derivative - 1, xi)

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return the section's rotation, Phi itself, or its derivative: (N,) -> (n, N)."""
        return self.values(xi, derivative)


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
    c = vectors.T
    c = c / np.sqrt(np.einsum("ij,jk,ik->i", c, k.rotations, c))[:, None]
    shapes = ReducedShapes(np.maximum(squares, 0.0) ** 0.25, basis, c, np.zeros(n))
    sign = np.where(shapes.rotation(np.zeros(1), 1)[:, 0] < 0, -1.0, 1.0)
    return replace(shapes, coefficients=c * sign[:, None])
