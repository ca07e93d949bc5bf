"""Open chains as products of exponentials, with all partial derivatives by multiplication alone."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.mechanics.screws.twists import Ad, ad, exponential, hat
from flexlin.summary import immutable


@immutable
class OpenChain:
    """An open chain of one-degree-of-freedom joints as a product of exponentials.

        H(q) = exp([t_1 x] q_1) ... exp([t_n x] q_n) H(0)

    Assumes the screws of the zero configuration, all in the base frame.

    Parameters
    ----------
    screws : array_like, shape (n, 6)
        One screw [w; v] for each joint, from the base on.
    pose : array_like, shape (4, 4), optional
        Pose H(0) of the last body in the zero configuration, lengths in m; by default the identity.

    Attributes
    ----------
    screws : array, shape (n, 6)
        The screws.
    home : array, shape (4, 4)
        H(0).

    Raises
    ------
    ArgumentError
        When a shape does not fit or the pose is not a rigid motion.

    References
    ----------
    Brockett (1984); de Jong, Müller, van Dijk, Herder (2018), Eq (5).

    Examples
    --------
    A planar arm of two links of 1 m, stretched out and then bent at the elbow:

    >>> import numpy as np
    >>> from flexlin.mechanics.screws import OpenChain, revolute
    >>> tip = np.eye(4)
    >>> tip[0, 3] = 2.0
    >>> arm = OpenChain([revolute([0, 0, 1], [0, 0, 0]), revolute([0, 0, 1], [1, 0, 0])], tip)
    >>> (arm.pose([0.0, np.pi / 2])[:3, 3].round(12) + 0.0).tolist()
    [1.0, 1.0, 0.0]
    >>> (arm.partial([0.0, np.pi / 2], [1, 0])[:3, 3].round(12) + 0.0).tolist()
    [-1.0, 1.0, 0.0]
    """

    screws: Array
    home: Array

    @checked
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
        """Return the pose of the last body.

        Parameters
        ----------
        q : array_like, shape (n,)
            Coordinates of the joints, in rad or m.

        Returns
        -------
        array, shape (4, 4)
            H(q).
        """
        return self.motions(q)[-1] @ self.home

    def expression(self, q: Sequence[Any], body: Array | None = None) -> Any:
        """Return the pose of the last body, or what it moves, as a CasADi expression.

        Parameters
        ----------
        q : sequence of CasADi scalars
            Coordinates of the n joints, in rad or m.
        body : array, shape (4, k), optional
            What is moved, such as a point [x; 1] in m; by default the pose itself is returned.

        Returns
        -------
        CasADi matrix, shape (4, 4) or (4, k)
            H(q), or H(q) times the body.
        """
        moved: Any = self.home if body is None else self.home @ body
        for t, q_k in zip(self.screws[::-1], q[::-1], strict=True):
            moved = exponential(t, q_k, moved)
        return moved

    def adjoint(self, q: ArrayLike) -> Array:
        """Return the adjoint matrix of the pose.

        Parameters
        ----------
        q : array_like, shape (n,)
            Coordinates of the joints, in rad or m.

        Returns
        -------
        array, shape (6, 6)
            Ad(H(q)).
        """
        return Ad(self.pose(q))

    def motions(self, q: ArrayLike) -> list[Array]:
        """Return the partial products of the chain.

        Parameters
        ----------
        q : array_like, shape (n,)
            Coordinates of the joints, in rad or m.

        Returns
        -------
        list of array, shape (4, 4)
            I, exp_1, exp_1 exp_2, ...: n + 1 poses.
        """
        products = [np.eye(4)]
        for t, angle in zip(self.screws, real_array("q", q, (self.n,)), strict=True):
            products.append(products[-1] @ exponential(t, angle))
        return products

    def instantaneous_screws(self, q: ArrayLike) -> Array:
        """Return the screws where the chain stands.

            t_i(q) = Ad(exp_1 ... exp_(i-1)) t_i

        Parameters
        ----------
        q : array_like, shape (n,)
            Coordinates of the joints, in rad or m.

        Returns
        -------
        array, shape (n, 6)
            The screws at q, in the base frame.
        """
        return np.array([Ad(H) @ t for H, t in zip(self.motions(q)[:-1], self.screws, strict=True)])

    def partial(self, q: ArrayLike, alpha: Sequence[int]) -> Array:
        """Return a partial derivative of the pose, of any order, by products of instantaneous screws.

            D^alpha H = [t_1 x]^alpha_1 ... [t_n x]^alpha_n H

        Parameters
        ----------
        q : array_like, shape (n,)
            Coordinates of the joints, in rad or m.
        alpha : sequence of int
            Orders of differentiation, one from 0 on for each joint.

        Returns
        -------
        array, shape (4, 4)
            The derivative.

        Raises
        ------
        ArgumentError
            When alpha is no multi-index of n entries.

        References
        ----------
        de Jong, Müller, van Dijk, Herder (2018), Eq (13), in its 4 x 4 form.
        """
        return self.screw_product(q, alpha, hat) @ self.pose(q)

    def adjoint_partial(self, q: ArrayLike, alpha: Sequence[int]) -> Array:
        """Return a partial derivative of the adjoint matrix of the pose.

            D^alpha Ad(H) = ad(t_1)^alpha_1 ... ad(t_n)^alpha_n Ad(H)

        Parameters
        ----------
        q : array_like, shape (n,)
            Coordinates of the joints, in rad or m.
        alpha : sequence of int
            Orders of differentiation, one from 0 on for each joint.

        Returns
        -------
        array, shape (6, 6)
            The derivative.

        References
        ----------
        de Jong, Müller, van Dijk, Herder (2018), Eq (13).
        """
        return self.screw_product(q, alpha, ad) @ self.adjoint(q)

    def screw_product(self, q: ArrayLike, alpha: Sequence[int], matrix_of: Callable[[Array], Array]) -> Array:
        """Multiply powers of the matrices of the instantaneous screws, in the order of the chain.

        Parameters
        ----------
        q : array_like, shape (n,)
            Coordinates of the joints, in rad or m.
        alpha : sequence of int
            Exponents, one from 0 on for each joint.
        matrix_of : callable
            Screw (6,) -> matrix: `hat` or `ad`.

        Returns
        -------
        array, shape (4, 4) or (6, 6)
            matrix_of(t_1)^alpha_1 ... matrix_of(t_n)^alpha_n.

        Raises
        ------
        ArgumentError
            When alpha is no multi-index of n entries.
        """
        orders = np.asarray(alpha)
        if orders.shape != (self.n,) or orders.dtype.kind not in "iu" or orders.min(initial=0) < 0:
            raise ArgumentError("alpha is no multi-index", got=alpha, expected=f"{self.n} integers >= 0")
        matrices = [matrix_of(t) for t in self.instantaneous_screws(q)]
        product = np.eye(len(matrix_of(np.zeros(6))))
        for matrix, order in zip(matrices, orders, strict=True):
            product = product @ np.linalg.matrix_power(matrix, int(order))
        return product
