"""Taylor expansion and linearization of matrix functions from their Kronecker derivatives, NumPy and CasADi alike.

And the recursion for closure Jacobians of any order in this layout, in NumPy: the readable reference route.
"""

from collections.abc import Sequence
from math import factorial
from typing import NamedTuple

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError
from flexlin.kronecker.algebra import Matrix, chain_rule, expect_columns, kron, kronecker_power, swap


class LinearizedProduct(NamedTuple):
    """A(x, y) y ~ value + by_y (y - y0) + by_x (x - x0)."""

    value: Matrix
    by_y: Matrix
    by_x: Matrix


@checked
def taylor_sum(derivatives: Sequence[Matrix], delta: Matrix) -> Matrix:
    """Sum a Taylor expansion of a scalar, vector or matrix function.

        A(x0 + delta) ~ A(x0) + sum_j  1/j! D^j A(x0) (E_p (x) delta^(x)j)

    Parameters
    ----------
    derivatives : sequence of array or CasADi matrix
        A(x0) (m, p), D A (m, p n), D^2 A (m, p n^2) and so on.
    delta : array or CasADi matrix, shape (n, 1)
        Step from x0.

    Returns
    -------
    array or CasADi matrix, shape (m, p)
        The value of the polynomial.

    Raises
    ------
    ArgumentError
        When the width of a derivative does not fit.

    References
    ----------
    Khang, Dat, Tuan (2019), Eq (47), with its cases (36) for scalars and (41) for vectors.

    Examples
    --------
    exp(0.1) from the first three derivatives at 0:

    >>> import numpy as np
    >>> from flexlin.kronecker import taylor_sum
    >>> one = np.array([[1.0]])
    >>> print(f"{taylor_sum([one, one, one, one], np.array([[0.1]])).item():.6f}")
    1.105167
    """
    if not derivatives:
        raise ArgumentError("a Taylor sum needs the value at least", got="no derivatives", expected="[A, DA, D2A ...]")
    total = derivatives[0]
    for j, DjA in enumerate(derivatives[1:], start=1):
        expect_columns(f"derivative {j}", DjA, total.shape[1] * delta.shape[0] ** j)
        total = total + chain_rule(DjA, kronecker_power(delta, j)) / factorial(j)
    return total


@checked
def linearization(A0: Matrix, *terms: tuple[Matrix, Matrix]) -> Matrix:
    """Linearize a matrix function of one, two or more vectors.

        A(x, y) ~ A(x0, y0) + dA/dx (E_p (x) dx) + dA/dy (E_p (x) dy)

    Parameters
    ----------
    A0 : array or CasADi matrix, shape (m, p)
        The value at the point.
    *terms : tuple of two arrays or CasADi matrices
        A pair (dA/dx (m, p n), dx (n, 1)) for each vector.

    Returns
    -------
    array or CasADi matrix, shape (m, p)
        The linear approximation.

    Raises
    ------
    ArgumentError
        When a derivative does not fit its vector.

    References
    ----------
    Khang, Dat, Tuan (2019), Eqs (48), (50).

    Examples
    --------
    x y near x = 2, y = 3:

    >>> import numpy as np
    >>> from flexlin.kronecker import linearization
    >>> step = np.array([[0.1]])
    >>> linearization(np.array([[6.0]]), (np.array([[3.0]]), step), (np.array([[2.0]]), step))
    array([[6.5]])
    """
    total = A0
    for DA, delta in terms:
        expect_columns("a derivative", DA, A0.shape[1] * delta.shape[0])
        total = total + chain_rule(DA, delta)
    return total


@checked
def bilinear_term(DxDyA: Matrix, dx: Matrix, dy: Matrix) -> Matrix:
    """Return the mixed second-order term of a matrix function of two vectors.

        d/dx (dA/dy) (E_(p ny) (x) dx)(E_p (x) dy)

    Parameters
    ----------
    DxDyA : array or CasADi matrix, shape (m, p ny nx)
        Derivative first by y, then by x.
    dx : array or CasADi matrix, shape (nx, 1)
        Step of x.
    dy : array or CasADi matrix, shape (ny, 1)
        Step of y.

    Returns
    -------
    array or CasADi matrix, shape (m, p)
        The term.

    Raises
    ------
    ArgumentError
        When the derivative does not fit its vectors.

    References
    ----------
    Khang, Dat, Tuan (2019), last term of Eq (49), with E_(p ny) where E_p is printed.

    Examples
    --------
    The mixed term of A = x y is dx dy:

    >>> import numpy as np
    >>> from flexlin.kronecker import bilinear_term
    >>> bilinear_term(np.array([[1.0]]), np.array([[0.5]]), np.array([[0.25]]))
    array([[0.125]])
    """
    return chain_rule(chain_rule(DxDyA, dx), dy)


@checked
def linearized_product(A0: Matrix, y0: Matrix, DyA: Matrix, DxA: Matrix) -> LinearizedProduct:
    """Linearize a matrix function times one of its own vectors.

        A(x, y) y ~ A0 y0 + (A0 + dA/dy (y0 (x) E_ny)) dy + dA/dx (y0 (x) E_nx) dx

    With dA/dy = 0 this is Eq (53) of the paper.

    Parameters
    ----------
    A0 : array or CasADi matrix, shape (m, p)
        A at (x0, y0).
    y0 : array or CasADi matrix, shape (p, 1)
        The vector that A multiplies.
    DyA : array or CasADi matrix, shape (m, p p)
        Derivative of A by y.
    DxA : array or CasADi matrix, shape (m, p nx)
        Derivative of A by x.

    Returns
    -------
    LinearizedProduct
        value (m, 1), by_y (m, p), by_x (m, nx).

    References
    ----------
    Khang, Dat, Tuan (2019), Eq (52), with the identities E_ny and E_nx where E_n is printed.

    Examples
    --------
    y^2 x, read as (x y) y, near x = 2, y = 3:

    >>> import numpy as np
    >>> from flexlin.kronecker import linearized_product
    >>> product = linearized_product(*[np.array([[value]]) for value in (6.0, 3.0, 2.0, 3.0)])
    >>> [part.item() for part in product]
    [18.0, 12.0, 9.0]
    """
    by_y = A0 + DyA @ kron(y0, np.eye(y0.shape[0]))
    nx = DxA.shape[1] // A0.shape[1]
    return LinearizedProduct(A0 @ y0, by_y, DxA @ kron(y0, np.eye(nx)))


def closure_jacobians(derivatives: Sequence[Array], nv: int) -> list[Array]:
    """Return C_1 ... C_N, the derivatives of v(u) with f(u, v) = 0, from the derivatives of f.

        V C_1 = -U,   V C_k = -F_k G_k,   K = [C_1; E]
        F_2     = [D V, D U],           G_2     = K (x) K
        F_(k+1) = [D V, D F_k, F_k],    G_(k+1) = [C_k (x) K; G_k (x) K; D_u G_k]

    where D is by s = [v; u]. Sizes grow like (nv + nu)^N nu^N: meant for small N and as a judge of faster routes.

    Parameters: derivatives: D f (nv, n), D^2 f (nv, n^2), ... D^N f by s = [v; u] at one point; nv: the number of dependent coordinates.
    Returns: C_k (nv, nu^k) for k = 1 ... N.
    Raises: ArgumentError when shapes do not fit; TooLarge with the bytes of F_N and G_N. A singular V raises numpy's LinAlgError.
    Source: de Jong et al., Eqs (14)-(24), corrected: s = [v; u], plus in (21), blocks side by side in (23), (24), and Vetter's permutation.
    """
    n = derivatives[0].shape[1]
    for k, D in enumerate(derivatives, start=1):
        if D.shape != (nv, n**k):
            raise ArgumentError(
                f"derivative {k} of the closure has the wrong shape", got=D.shape, expected=f"({nv}, {n**k})"
            )
    order, nu = len(derivatives), n - nv
    refuse_if_large(order, nv, nu)
    DV = [D[:, : nv * n**k] for k, D in enumerate(derivatives)]
    DU = [D[:, nv * n**k :] for k, D in enumerate(derivatives)]
    C = [-np.linalg.solve(DV[0], DU[0])]
    F = [np.hstack(pair) for pair in zip(DV[1:], DU[1:], strict=True)]
    for _ in range(1, order):
        C.append(-np.linalg.solve(DV[0], F[0] @ build_right_factor(C, nu)))
        F = [np.hstack([DV[j + 1], F[j + 1], F[j]]) for j in range(len(F) - 1)]
    return C


def refuse_if_large(order: int, nv: int, nu: int) -> None:
    """Refuse an order whose F_N (nv, N_N) and G_N (N_N, nu^N) are unreasonable: N_2 = n^2, N_(k+1) = nv n + N_k n + N_k.

    G_N is made from G_(N-1) and its derivative, of the same size together: two of it are held.
    """
    n, columns = nv + nu, 0
    for k in range(2, order + 1):
        columns = n**2 if k == 2 else nv * n + columns * (n + 1)
    size = 8 * columns * (nv + 2 * nu**order)
    check_size(f"the dense recursion of order {order}", size, "use the series engine: implicit_taylor")


def build_right_factor(C: Sequence[Array], nu: int) -> Array:
    """Return G_k from C_1 ... C_(k-1): G_2, then G_3 ... each with as many derivatives by u as the next one needs."""
    K = [np.vstack([Ck, np.eye(nu) if k == 1 else np.zeros((nu, nu**k))]) for k, Ck in enumerate(C, start=1)]
    G = kronecker_jet(K, K, nu)
    for j in range(2, len(C) + 1):
        depth = len(G) - 1
        parts = zip(
            kronecker_jet(C[j - 1 : j - 1 + depth], K[:depth], nu),
            kronecker_jet(G[:depth], K[:depth], nu),
            G[1:],
            strict=True,
        )
        G = [np.vstack(part) for part in parts]
    return G[0]


def kronecker_jet(A: Sequence[Array], B: Sequence[Array], n: int) -> list[Array]:
    """Differentiate a Kronecker product repeatedly, given A, D A, D^2 A ... and B, D B ... by x in R^n.

        D(A (x) B) = (D A (x) B)(E_p (x) P) + A (x) D B,   D^j(X Pi) = D^j X (Pi (x) E_(n^j))

    Returns: A (x) B, D(A (x) B), ... as many as given of A and B.
    Source: Vetter (1973), Khang et al., Eq (21).
    """
    jet = [np.kron(A[0], B[0])]
    if len(A) == 1:
        return jet
    permutation = np.kron(np.eye(A[0].shape[1]), swap(n, B[0].shape[1]))
    left, right = kronecker_jet(A[1:], B[:-1], n), kronecker_jet(A[:-1], B[1:], n)
    for j, (DA_B, A_DB) in enumerate(zip(left, right, strict=True)):
        columns = np.kron(permutation, np.eye(n**j)).argmax(axis=0)
        jet.append(DA_B[:, columns] + A_DB)
    return jet
