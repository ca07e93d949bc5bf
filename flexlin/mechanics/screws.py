"""Screws: twists, adjoint maps and products of exponentials, with all partial derivatives by multiplication alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError


def cross(w: Array) -> Array:
    """Return [w x] (3, 3), so that [w x] a = w x a."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def hat(t: Array) -> Array:
    """Return [t x] = [[[w x], v], [0, 0]] (4, 4) of a twist t = [w; v]: H' = [t x] H, de Jong et al., Eq (1)."""
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = cross(t[:3]), t[3:]
    return matrix


def Ad(H: Array) -> Array:
    """Return Ad(H) = [[R, 0], [[o x] R, R]] (6, 6), which moves twists between frames: de Jong et al., Eq (2)."""
    R = H[:3, :3]
    return np.block([[R, np.zeros((3, 3))], [cross(H[:3, 3]) @ R, R]])


def ad(t: Array) -> Array:
    """Return ad(t) = [[[w x], 0], [[v x], [w x]]] (6, 6), so that d/dt Ad(H) = ad(t) Ad(H): de Jong et al., Eq (3)."""
    W, V = cross(t[:3]), cross(t[3:])
    return np.block([[W, np.zeros((3, 3))], [V, W]])


def revolute(axis: ArrayLike, point: ArrayLike) -> Array:
    """Return the screw of a hinge about `axis` through `point` (m): t = [e; p x e], coordinate in rad."""
    return helical(axis, point, 0.0)


def helical(axis: ArrayLike, point: ArrayLike, pitch: float) -> Array:
    """Return the screw of a helical joint: t = [e; p x e + h e], with pitch h in m/rad."""
    e, p = unit("axis", axis), real_array("point", point, (3,))
    return np.concatenate([e, np.cross(p, e) + float(real_array("pitch", pitch, ())) * e])


def prismatic(direction: ArrayLike) -> Array:
    """Return the screw of a slider along `direction`: t = [0; e], coordinate in m."""
    return np.concatenate([np.zeros(3), unit("direction", direction)])


def exponential(t: Array, q: Any) -> Any:
    """Return the motion along a constant screw.

        exp([t x] q) = I + q X + (1 - cos w q)/w^2 X^2 + (w q - sin w q)/w^3 X^3,   X = [t x],  w = |omega|

    and I + q X for w = 0.

    Parameters: t = [omega; v] (6,); q in rad (revolute, helical) or m (prismatic): a float or a CasADi scalar.
    Returns: (4, 4), of the kind of q.
    Source: Rodrigues' formula by the minimal polynomial X^4 = -w^2 X^2; Brockett (1984), de Jong et al., Eq (5).
    """
    X, w = hat(t), float(np.linalg.norm(t[:3]))
    if w == 0.0:
        return np.eye(4) + q * X
    sin = np.sin if isinstance(q, float) else type(q).sin
    versine, rest = 2 * sin(w * q / 2) ** 2 / w**2, (w * q - sin(w * q)) / w**3
    return np.eye(4) + q * X + versine * (X @ X) + rest * (X @ X @ X)


@dataclass(frozen=True)
class OpenChain:
    """An open chain of one-degree-of-freedom joints as a product of exponentials.

        H(q) = exp([t_1 x] q_1) ... exp([t_n x] q_n) H(0)

    Assumes the screws of the zero configuration, all in the base frame.

    Parameters: screws (n, 6), rows [w; v]; pose H(0) (4, 4) of the last body.
    Raises: ArgumentError when a shape does not fit or the pose is not a rigid motion.
    Source: Brockett (1984); de Jong et al., Eq (5).
    """

    screws: Array
    home: Array

    def __init__(self, screws: ArrayLike, pose: ArrayLike | None = None):
        home = real_array("pose", np.eye(4) if pose is None else pose, (4, 4))
        R = home[:3, :3]
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-9) or not np.array_equal(home[3], [0, 0, 0, 1]):
            raise ArgumentError("pose is not a rigid motion", got=home.tolist(), expected="[[R, o], [0, 1]], R R' = I")
        object.__setattr__(self, "screws", real_array("screws", screws, (None, 6)))
        object.__setattr__(self, "home", home)

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.screws)

    def pose(self, q: ArrayLike) -> Array:
        """Return H(q) (4, 4)."""
        return self.motions(q)[-1] @ self.home

    def expression(self, q: Sequence[Any]) -> Any:
        """Return H(q) as a CasADi expression (4, 4) of n CasADi scalars."""
        H = self.home
        for t, angle in zip(reversed(self.screws), reversed(q), strict=True):
            H = exponential(t, angle) @ H
        return H

    def adjoint(self, q: ArrayLike) -> Array:
        """Return Ad(H(q)) (6, 6)."""
        return Ad(self.pose(q))

    def motions(self, q: ArrayLike) -> list[Array]:
        """Return the partial products I, exp_1, exp_1 exp_2, ... (n + 1 of them)."""
        products = [np.eye(4)]
        for t, angle in zip(self.screws, real_array("q", q, (self.n,)), strict=True):
            products.append(products[-1] @ exponential(t, angle))
        return products

    def instantaneous_screws(self, q: ArrayLike) -> Array:
        """Return the screws at q, in the base frame (n, 6): t_i(q) = Ad(exp_1 ... exp_(i-1)) t_i."""
        return np.array([Ad(H) @ t for H, t in zip(self.motions(q)[:-1], self.screws, strict=True)])

    def partial(self, q: ArrayLike, alpha: Sequence[int]) -> Array:
        """Return a partial derivative of the pose, of any order, by products of instantaneous screws.

            D^alpha H = [t_1 x]^alpha_1 ... [t_n x]^alpha_n H

        Parameters: q (n,); alpha: n orders of differentiation >= 0.
        Returns: (4, 4).
        Source: de Jong et al., Eq (13), in its 4 x 4 form.
        """
        return self.screw_product(q, alpha, hat) @ self.pose(q)

    def adjoint_partial(self, q: ArrayLike, alpha: Sequence[int]) -> Array:
        """Return D^alpha Ad(H) = ad(t_1)^alpha_1 ... ad(t_n)^alpha_n Ad(H) (6, 6): de Jong et al., Eq (13)."""
        return self.screw_product(q, alpha, ad) @ self.adjoint(q)

    def screw_product(self, q: ArrayLike, alpha: Sequence[int], matrix_of: Callable[[Array], Array]) -> Array:
        """Multiply the powers of the instantaneous screws' matrices in the order of the chain."""
        orders = np.asarray(alpha)
        if orders.shape != (self.n,) or orders.dtype.kind not in "iu" or orders.min(initial=0) < 0:
            raise ArgumentError("alpha is no multi-index", got=alpha, expected=f"{self.n} integers >= 0")
        matrices = [matrix_of(t) for t in self.instantaneous_screws(q)]
        product = np.eye(len(matrix_of(np.zeros(6))))
        for matrix, order in zip(matrices, orders, strict=True):
            product = product @ np.linalg.matrix_power(matrix, int(order))
        return product


def unit(name: str, vector: ArrayLike) -> Array:
    """Return a checked vector of R^3 scaled to length 1."""
    direction = real_array(name, vector, (3,))
    length = np.linalg.norm(direction)
    if length == 0.0:
        raise ArgumentError(f"{name} has no direction", got=direction.tolist(), expected="a vector other than zero")
    return direction / length
