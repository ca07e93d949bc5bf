"""The integrals of the shapes that the energies of a link need, computed once, before any expression graph is built."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexlin.checks import SUM_ROUNDING, Array


@dataclass(frozen=True)
class Profile:
    """A relative property over xi in [0, 1], smooth between its breaks.

    Parameters: function (N,) -> (N,); breaks: places in (0, 1) at which it or a derivative jumps.
    """

    function: Callable[[Array], Array]
    breaks: tuple[float, ...] = ()

    def __call__(self, xi: Array) -> Array:
        return self.function(xi)

    @classmethod
    def table(cls, xi: Sequence[float], values: Sequence[float]) -> "Profile":
        """Interpolate a table linearly, as the scene's `sections` has been checked: xi (k,) from 0 to 1, values (k,) positive."""
        return cls(lambda x: np.interp(x, xi, values), tuple(xi[1:-1]))


UNIFORM = Profile(np.ones_like)


class Shapes:
    """Assumed modes X_1 ... X_n of a link, dimensionless, over xi = x/l.

    Attributes: n modes; beta (n,), the roots beta*l (omega = beta^2 sqrt(EI/(rhoA l^4)) for the beam the shapes belong to), which a basis
    does not have; breaks: places in (0, 1) where a derivative of the shapes jumps, at which a quadrature must be split;
    order: number of Gauss nodes between two breaks that integrates products of two shapes to rounding.
    """

    n: int
    order: int
    beta: Array
    breaks: tuple[float, ...] = ()

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return X or its derivative (0 to 3) with respect to xi: (N,) -> (n, N)."""
        raise NotImplementedError

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return the section's rotation psi or its derivative: (N,) -> (n, N); psi = X' where nothing shears."""
        return self.values(xi, derivative + 1)


@dataclass(frozen=True)
class ShapeIntegrals:
    """Integrals over xi in [0, 1] of shapes X with relative mass mu and relative bending stiffness eps.

        Gamma(xi) = int_0^xi X' X'^T,   psi: the section's rotation, X' where nothing shears

    All are dimensionless; the chain scales them: int rhoA X dx = rhoA l mode, int EI X''^2 dx = EI / l^3 bending,
    int rhoA Gamma dx = rhoA shortening, and so on. Shapes: n = number of modes.
    """

    mass: float
    first: float
    second: float
    mode: Array
    mode_moment: Array
    gram: Array
    bending: Array
    shortening: Array
    shortening_moment: Array
    tip: Array
    tip_slope: Array
    tip_shortening: Array
    base_slope: Array
    section: float
    rotation: Array
    rotations: Array
    shear: Array

    @property
    def n(self) -> int:
        """The number of modes."""
        return len(self.tip)


def shape_integrals(shapes: Shapes, mu: Profile = UNIFORM, eps: Profile = UNIFORM) -> ShapeIntegrals:
    """Integrate the shapes by Gauss-Legendre quadrature between their breaks.

        mass = int mu,  first = int mu xi,  second = int mu xi^2,  mode = int mu X,  mode_moment = int mu xi X,
        gram = int mu X X^T,  bending = int eps psi' psi'^T,  shortening = int mu Gamma,  shortening_moment = int mu xi Gamma,
        section = int eps,  rotation = int eps psi,  rotations = int eps psi psi^T,  shear = int mu (X' - psi) (X' - psi)^T

    Assumes shapes and profiles smooth between their breaks, and the profiles resolved by 8 nodes more than the shapes need.

    Parameters: profiles mu relative to the link's own mass per length, eps to its stiffness (and second moment of area).
    Returns: ShapeIntegrals, (n,) and (n, n) arrays; zero-size when there are no modes.
    """
    edges = np.unique([0.0, *shapes.breaks, *mu.breaks, *eps.breaks, 1.0])
    order = shapes.order + 8
    xi, weight = panels(edges, order)
    outer, outer_first = remaining(mu, edges, order)  # int mu Gamma = int X' X'^T (int_xi^1 mu), by parts
    X, slope = shapes.values(xi), shapes.values(xi, 1)
    psi, curvature = shapes.rotation(xi), shapes.rotation(xi, 1)
    ends = np.array([0.0, 1.0])
    at_ends, turns = shapes.values(ends), shapes.rotation(ends)
    load, second = weight * mu(xi), weight * eps(xi)
    return ShapeIntegrals(
        mass=float(load.sum()),
        first=float(load @ xi),
        second=float(load @ xi**2),
        mode=X @ load,
        mode_moment=X @ (load * xi),
        gram=orthogonal((X * load) @ X.T),
        bending=orthogonal((curvature * second) @ curvature.T),
        shortening=(slope * weight * outer) @ slope.T,
        shortening_moment=(slope * weight * outer_first) @ slope.T,
        tip=at_ends[:, 1],
        tip_slope=turns[:, 1],
        tip_shortening=(slope * weight) @ slope.T,
        base_slope=turns[:, 0],
        section=float(second.sum()),
        rotation=psi @ second,
        rotations=(psi * second) @ psi.T,
        shear=((slope - psi) * load) @ (slope - psi).T,
    )


def orthogonal(products: Array) -> Array:
    """Set to zero what is zero but for rounding, relative to the diagonal: modes are orthogonal, and each zero saves instructions."""
    size = np.sqrt(np.diag(products))
    return np.where(np.abs(products) > SUM_ROUNDING * np.outer(size, size), products, 0.0)


@lru_cache(maxsize=64)
def gauss_legendre(order: int) -> tuple[Array, Array]:
    """Nodes and weights on [-1, 1], kept: finding them costs more than using them."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return nodes, weights


def panels(edges: Array, order: int) -> tuple[Array, Array]:
    """Return nodes and weights of a Gauss-Legendre rule on each panel, one after the other."""
    nodes, weights = gauss_legendre(order)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (nodes + 1)).ravel(), (half * weights).ravel()


def remaining(mu: Profile, edges: Array, order: int) -> tuple[Array, Array]:
    """Return int_xi^1 mu and int_xi^1 mu s ds at the nodes of `panels`."""
    nodes, weights = gauss_legendre(order)
    xi, weight = panels(edges, order)
    ends = np.repeat(edges[1:], order)
    half = (ends - xi)[:, None] / 2
    inner = xi[:, None] + half * (nodes + 1)
    load = mu(inner.ravel()).reshape(inner.shape) * half * weights
    whole = (weight * mu(xi)).reshape(-1, order)
    beyond = [
        np.append(np.cumsum(panel.sum(axis=1)[::-1])[::-1][1:], 0.0) for panel in (whole, whole * xi.reshape(-1, order))
    ]
    return load.sum(axis=1) + np.repeat(beyond[0], order), (load * inner).sum(axis=1) + np.repeat(beyond[1], order)


@dataclass(frozen=True)
class Couplings:
    """Products of shapes Y (bent in y), Z (bent in z) and Phi (twist), with psi the rotations of sections, dimensionless.

    across = int mu Y Z^T,   sections = int eps psi_y psi_z^T
    turn: 1/2 int (psi_y psi_z'^T - psi_y' psi_z^T), and 1/2 int (Phi' psi^T - Phi psi'^T) with psi_y and with psi_z
    turns: the same integrated over the sections, int eps (int_0^xi ... ds) dxi
    and of the twist with each of the two: tip = int (1 - xi) Phi psi'^T,
    mass = int mu X2,   moment = int mu xi X2   with X2(xi) = int_0^xi (xi - s) Phi psi'^T ds
        and section = int eps Phi psi^T
    """

    across: Array
    sections: Array
    turn: tuple[Array, Array, Array]
    turns: tuple[Array, Array, Array]
    tip: tuple[Array, Array]
    mass: tuple[Array, Array]
    moment: tuple[Array, Array]
    section: tuple[Array, Array]


def couple_shapes(y: Shapes, z: Shapes, twist: Shapes, mu: Profile, eps: Profile) -> Couplings:
    """Integrate the products by Gauss-Legendre quadrature between all breaks; profiles as in `shape_integrals`."""
    edges = np.unique([0.0, *y.breaks, *z.breaks, *twist.breaks, *mu.breaks, *eps.breaks, 1.0])
    order = max(shapes.order for shapes in (y, z, twist)) + 8
    xi, weight = panels(edges, order)
    turn = [shapes.rotation(xi) for shapes in (y, z)]
    curvature = [shapes.rotation(xi, 1) for shapes in (y, z)]
    phi, slope = twist.rotation(xi), twist.rotation(xi, 1)
    plain, first = remaining(mu, edges, order)  # int_xi^1 mu s^k ds
    second = remaining(Profile(lambda s: s * mu(s), mu.breaks), edges, order)[1]

    def with_twist(weight: Array, bent: list[Array]) -> tuple[Array, Array]:
        in_y, in_z = ((phi * weight) @ part.T for part in bent)
        return in_y, in_z

    def turned(weight: Array) -> tuple[Array, Array, Array]:
        pairs = ((turn[0], curvature[0], turn[1], curvature[1]), *((phi, slope, turn[i], curvature[i]) for i in (0, 1)))
        x, by_y, by_z = (((a * weight) @ db.T - (da * weight) @ b.T) / 2 for a, da, b, db in pairs)
        return x, -by_y, -by_z

    return Couplings(
        across=(y.values(xi) * weight * mu(xi)) @ z.values(xi).T,
        sections=(turn[0] * weight * eps(xi)) @ turn[1].T,
        turn=turned(weight),
        turns=turned(weight * remaining(eps, edges, order)[0]),
        tip=with_twist(weight * (1 - xi), curvature),
        mass=with_twist(weight * (first - xi * plain), curvature),
        moment=with_twist(weight * (second - xi * first), curvature),
        section=with_twist(weight * eps(xi), turn),
    )
