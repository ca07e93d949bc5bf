"""Screws: twists, adjoint maps and products of exponentials, with all partial derivatives by multiplication alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.summary import represent


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


def exponential(t: Array, q: Any, body: Any = None) -> Any:
    """Return the motion along a constant screw, or its product with a matrix such as a point [x; 1].

        exp([t x] q) = E + X^2/w^2 + (X + X^3/w^2) q - X^3/w^3 sin(w q) - X^2/w^2 cos(w q),   X = [t x],  w = |omega|

    and E + q X for w = 0. The term in q is there for helical joints only.

    Parameters: t = [omega; v] (6,); q in rad (revolute, helical) or m (prismatic): a float or a CasADi scalar; body (4, k).
    Returns: (4, 4) or (4, k), of the kind of q.
    Source: Rodrigues' formula by the minimal polynomial X^4 = -w^2 X^2; Brockett (1984), de Jong et al., Eq (5).
    """
    X, w = hat(t), float(np.linalg.norm(t[:3]))
    body = np.eye(4) if body is None else body
    if w == 0.0:
        return body + q * (X @ body)
    sin, cos = (np.sin, np.cos) if isinstance(q, float) else (type(q).sin, type(q).cos)
    square, cube = X @ X / w**2, X @ X @ X / w**2
    moved = (np.eye(4) + square) @ body + sin(w * q) * (-cube / w @ body) + cos(w * q) * (-square @ body)
    advance = X + cube
    return moved + q * (advance @ body) if np.abs(advance).max() > 1e-15 * np.abs(X).max() else moved


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

    __repr__ = represent

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

    def expression(self, q: Sequence[Any], body: Array | None = None) -> Any:
        """Return H(q), or H(q) times a matrix such as a point [x; 1] (4, 1), as a CasADi expression of n CasADi scalars."""
        moved: Any = self.home if body is None else self.home @ body
        for first, last in reversed(parallel_runs(self.screws)):
            moved = turn(self.screws[first:last], q[first:last], moved)
        return moved

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


def parallel_runs(screws: Array) -> list[tuple[int, int]]:
    """Return the runs [first, last) of neighbouring joints that are hinges with one direction of axis, or single joints."""
    runs: list[tuple[int, int]] = []
    for i, t in enumerate(screws):
        before = screws[i - 1]
        hinges = all(np.any(s[:3]) and abs(s[:3] @ s[3:]) < 1e-15 for s in (t, before))
        if runs and hinges and np.array_equal(t[:3], before[:3]):
            runs[-1] = (runs[-1][0], i + 1)
        else:
            runs.append((i, i + 1))
    return runs


def turn(screws: Array, q: Sequence[Any], body: Any) -> Any:
    """Return the motion of a run of joints times a matrix; parallel hinges turn by the sums of their angles.

    x -> c_1 + R(q_1)(c_2 - c_1) + ... + R(q_1 + ... + q_m)(x - c_m),   c_k on the axis of hinge k
    """
    if len(screws) == 1:
        return exponential(screws[0], q[0], body)
    rotation = np.concatenate([screws[0, :3], np.zeros(3)])
    centres = np.zeros((len(screws), 4, 1))
    centres[:, :3, 0] = np.cross(screws[:, :3], screws[:, 3:]) / (rotation @ rotation)
    weight = body[3:4, :]
    moved, angle = centres[0] @ weight, 0
    for k, q_k in enumerate(q):
        angle = angle + q_k
        end = centres[k + 1] @ weight if k + 1 < len(q) else body
        moved = moved + exponential(rotation, angle, end - centres[k] @ weight)
    return moved


def unit(name: str, vector: ArrayLike) -> Array:
    """Return a checked vector of R^3 scaled to length 1."""
    direction = real_array(name, vector, (3,))
    length = np.linalg.norm(direction)
    if length == 0.0:
        raise ArgumentError(f"{name} has no direction", got=direction.tolist(), expected="a vector other than zero")
    return direction / length
