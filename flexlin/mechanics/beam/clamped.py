"""Shapes of a beam clamped at its base, its tip free or carrying a rigid body."""

import numpy as np

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.mechanics.beam.uniform import UniformShapes, solve_modes


def clamped_free(n: int) -> UniformShapes:
    """Return the n lowest modes of a uniform cantilever.

        X = cosh(beta xi) - cos(beta xi) - sigma (sinh(beta xi) - sin(beta xi)),   1 + cos(beta) cosh(beta) = 0

    so that int X^2 = 1, X(1) = 2, -2, 2 ...

    Source: any textbook of vibrations, e.g. Blevins (1979), Table 8-1.
    """
    return clamped_with_tip(n)


def clamped_with_tip(n: int, mass: float = 0.0, inertia: float = 0.0, moment: float = 0.0) -> UniformShapes:
    """Return the n lowest modes of a uniform beam, clamped, with a rigid body on its tip.

        X(0) = X'(0) = 0,   X''(1) = beta^4 (inertia X'(1) + moment X(1)),   -X'''(1) = beta^4 (mass X(1) + moment X'(1))

    Parameters: mass / (rhoA l), first moment along the beam / (rhoA l^2), inertia about the tip / (rhoA l^3); int X^2 = 1 along the beam.
    Raises: ArgumentError when the numbers cannot belong to a rigid body.
    Source: De Luca, Siciliano (1991), Eqs (9)-(11).
    """
    mass, inertia, moment = (
        float(real_array(name, value, ())) for name, value in (("mass", mass), ("inertia", inertia), ("moment", moment))
    )
    if mass < 0 or inertia < 0 or moment**2 > mass * inertia:
        raise ArgumentError(
            "no rigid body has this mass, inertia and moment",
            got=(mass, inertia, moment),
            expected="mass >= 0, inertia >= 0, moment^2 <= mass * inertia",
        )

    def boundary(beta: Array, start: Array, end: Array) -> Array:
        b = beta[:, None]
        bending = end[:, 2] - inertia * b**3 * end[:, 1] - moment * b**2 * end[:, 0]
        shear = end[:, 3] + mass * b * end[:, 0] + moment * b**2 * end[:, 1]
        return np.stack([start[:, 0], start[:, 1], bending, shear], axis=1)

    return solve_modes(n, boundary)
