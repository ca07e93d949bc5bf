"""What the chain asks of the assumed modes of a link: values and derivatives over xi = x/l in [0, 1]."""

from typing import Protocol

from flexlin.checks import Array


class Shapes(Protocol):
    """Assumed modes X_1 ... X_n of a link, dimensionless, over xi = x/l.

    Attributes: n modes; beta (n,), the roots beta*l (omega = beta^2 sqrt(EI/(rhoA l^4)) for the beam the shapes belong to);
    breaks: places in (0, 1) where a derivative of the shapes jumps, at which a quadrature must be split;
    order: number of Gauss nodes between two breaks that integrates products of two shapes to rounding.
    """

    @property
    def n(self) -> int: ...

    @property
    def beta(self) -> Array: ...

    @property
    def breaks(self) -> tuple[float, ...]: ...

    @property
    def order(self) -> int: ...

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return X or its derivative (0 to 3) with respect to xi: (N,) -> (n, N)."""
        ...

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return the section's rotation psi or its derivative: (N,) -> (n, N); psi = X' where nothing shears."""
        ...
