"""Screws of joints, adjoint maps and the exponential of a screw."""

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import Kind, checked, is_number
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError

Coordinate = Annotated[
    Any, Kind("a number or a CasADi scalar", lambda q: is_number(q) or (hasattr(q, "nnz") and q.numel() == 1))
]


@checked
def skew(w: Array) -> Array:
    """Return the matrix of a cross product, [w x] a = w x a.

    Parameters
    ----------
    w : array, shape (3,)
        The left factor.

    Returns
    -------
    array, shape (3, 3)
        [w x], skew-symmetric.

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.mechanics.screws import skew
    >>> skew(np.array([0.0, 0.0, 1.0])) @ np.array([1.0, 0.0, 0.0])
    array([0., 1., 0.])
    """
    w = real_array("w", w, (3,))
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


@checked
def hat(t: Array) -> Array:
    """Return the 4 x 4 matrix of a twist.

        [t x] = [[[w x], v], [0, 0]],   H' = [t x] H   for a pose H that moves with the twist t = [w; v]

    Parameters
    ----------
    t : array, shape (6,)
        Twist: angular velocity w in rad/s and velocity v in m/s of the point at the origin.

    Returns
    -------
    array, shape (4, 4)
        The matrix.

    References
    ----------
    de Jong, Müller, van Dijk, Herder (2018), Eq (1).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.mechanics.screws import hat
    >>> hat(np.array([0.0, 0.0, 1.0, 2.0, 0.0, 0.0]))
    array([[ 0., -1.,  0.,  2.],
           [ 1.,  0., -0.,  0.],
           [-0.,  0.,  0.,  0.],
           [ 0.,  0.,  0.,  0.]])
    """
    t, matrix = real_array("t", t, (6,)), np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = skew(t[:3]), t[3:]
    return matrix


@checked
def Ad(H: Array) -> Array:
    """Return the adjoint matrix of a pose, which moves twists between frames.

        Ad(H) = [[R, 0], [[o x] R, R]],   H = [[R, o], [0, 1]]

    Parameters
    ----------
    H : array, shape (4, 4)
        A pose: rotation R, origin o in m.

    Returns
    -------
    array, shape (6, 6)
        The adjoint matrix.

    References
    ----------
    de Jong, Müller, van Dijk, Herder (2018), Eq (2).

    Examples
    --------
    A turn about z, seen from a frame 1 m further along x:

    >>> import numpy as np
    >>> from flexlin.mechanics.screws import Ad
    >>> H = np.eye(4)
    >>> H[0, 3] = 1.0
    >>> (Ad(H) @ [0, 0, 1, 0, 0, 0]).tolist()
    [0.0, 0.0, 1.0, 0.0, -1.0, 0.0]
    """
    H = real_array("H", H, (4, 4))
    R = H[:3, :3]
    return np.block([[R, np.zeros((3, 3))], [skew(H[:3, 3]) @ R, R]])


@checked
def ad(t: Array) -> Array:
    """Return the matrix of the Lie bracket with a twist.

        ad(t) = [[[w x], 0], [[v x], [w x]]],   d/dt Ad(H) = ad(t) Ad(H)

    Parameters
    ----------
    t : array, shape (6,)
        Twist [w; v], in rad/s and m/s.

    Returns
    -------
    array, shape (6, 6)
        The matrix; ad(t) t = 0.

    References
    ----------
    de Jong, Müller, van Dijk, Herder (2018), Eq (3).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.mechanics.screws import ad
    >>> t = np.array([0.0, 0.0, 1.0, 2.0, 0.0, 0.0])
    >>> bool(np.all(ad(t) @ t == 0))
    True
    """
    t = real_array("t", t, (6,))
    W, V = skew(t[:3]), skew(t[3:])
    return np.block([[W, np.zeros((3, 3))], [V, W]])


@checked
def revolute(axis: ArrayLike, point: ArrayLike) -> Array:
    """Return the screw of a hinge.

        t = [e; p x e],   e the axis as a unit vector

    Parameters
    ----------
    axis : array_like, shape (3,)
        Direction of the axis, of any length but zero.
    point : array_like, shape (3,)
        A point of the axis, in m.

    Returns
    -------
    array, shape (6,)
        The screw; its coordinate is an angle in rad.

    Raises
    ------
    ArgumentError
        When the axis is zero or a shape does not fit.

    Examples
    --------
    >>> from flexlin.mechanics.screws import revolute
    >>> revolute([0, 0, 2], [1, 0, 0]).tolist()
    [0.0, 0.0, 1.0, 0.0, -1.0, 0.0]
    """
    return helical(axis, point, 0.0)


@checked
def helical(axis: ArrayLike, point: ArrayLike, pitch: float) -> Array:
    """Return the screw of a helical joint.

        t = [e; p x e + h e],   e the axis as a unit vector

    Parameters
    ----------
    axis : array_like, shape (3,)
        Direction of the axis, of any length but zero.
    point : array_like, shape (3,)
        A point of the axis, in m.
    pitch : float
        Advance h, in m/rad.

    Returns
    -------
    array, shape (6,)
        The screw; its coordinate is an angle in rad.

    Raises
    ------
    ArgumentError
        When the axis is zero or a shape does not fit.

    Examples
    --------
    >>> from flexlin.mechanics.screws import helical
    >>> helical([0, 0, 1], [1, 0, 0], 0.01).tolist()
    [0.0, 0.0, 1.0, 0.0, -1.0, 0.01]
    """
    e, p = unit_vector("axis", axis), real_array("point", point, (3,))
    return np.concatenate([e, np.cross(p, e) + float(real_array("pitch", pitch, ())) * e])


@checked
def prismatic(direction: ArrayLike) -> Array:
    """Return the screw of a slider.

        t = [0; e],   e the direction as a unit vector

    Parameters
    ----------
    direction : array_like, shape (3,)
        Direction of the slider, of any length but zero.

    Returns
    -------
    array, shape (6,)
        The screw; its coordinate is a length in m.

    Raises
    ------
    ArgumentError
        When the direction is zero or its shape does not fit.

    Examples
    --------
    >>> from flexlin.mechanics.screws import prismatic
    >>> prismatic([3, 0, 4]).tolist()
    [0.0, 0.0, 0.0, 0.6, 0.0, 0.8]
    """
    return np.concatenate([np.zeros(3), unit_vector("direction", direction)])


@checked
def exponential(t: Array, q: Coordinate, body: Any = None) -> Any:
    """Return the motion along a constant screw, or its product with a matrix such as a point [x; 1].

        exp([t x] q) = E + X^2/w^2 + (X + X^3/w^2) q - X^3/w^3 sin(w q) - X^2/w^2 cos(w q),   X = [t x],  w = |omega|

    and E + q X for w = 0. The term in q is there for helical joints only.

    Parameters
    ----------
    t : array, shape (6,)
        The screw [omega; v].
    q : float or CasADi scalar
        Coordinate of the joint, in rad (revolute, helical) or m (prismatic).
    body : array or CasADi matrix, shape (4, k), optional
        What is moved; by default the identity.

    Returns
    -------
    array or CasADi matrix, shape (4, 4) or (4, k)
        The pose, or what was moved; of the kind of q.

    References
    ----------
    Rodrigues' formula by the minimal polynomial X^4 = -w^2 X^2; Brockett (1984); de Jong et al. (2018), Eq (5).

    Examples
    --------
    A quarter turn about an axis through (1, 0, 0) moves the origin to (1, -1, 0):

    >>> import numpy as np
    >>> from flexlin.mechanics.screws import exponential, revolute
    >>> moved = exponential(revolute([0, 0, 1], [1, 0, 0]), np.pi / 2, np.array([[0.0], [0.0], [0.0], [1.0]]))
    >>> (moved.ravel().round(12) + 0.0).tolist()
    [1.0, -1.0, 0.0, 1.0]
    """
    X, w = hat(t), float(np.linalg.norm(np.asarray(t)[:3]))
    body = np.eye(4) if body is None else body
    if w == 0.0:
        return body + q * (X @ body)
    sin, cos = (np.sin, np.cos) if is_number(q) else (type(q).sin, type(q).cos)
    square, cube = X @ X / w**2, X @ X @ X / w**2
    moved = (np.eye(4) + square) @ body + sin(w * q) * (-cube / w @ body) + cos(w * q) * (-square @ body)
    advance = X + cube
    return moved + q * (advance @ body) if np.abs(advance).max() > 1e-15 * np.abs(X).max() else moved


def unit_vector(name: str, vector: ArrayLike) -> Array:
    """Return a checked vector of R^3 scaled to length 1."""
    direction = real_array(name, vector, (3,))
    length = np.linalg.norm(direction)
    if length == 0.0:
        raise ArgumentError(f"{name} has no direction", got=direction.tolist(), expected="a vector other than zero")
    return direction / length
