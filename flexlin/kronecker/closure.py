"""The recursion for closure Jacobians of any order, in dense Kronecker form: the readable reference route, NumPy only."""

from collections.abc import Sequence

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError
from flexlin.kronecker.algebra import swap


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
