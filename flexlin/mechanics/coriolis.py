"""Centrifugal and Coriolis forces from the mass matrix."""

import casadi as ca

from flexlin.kronecker.symbolic import derivative


def derive_coriolis(M: ca.SX, s: ca.SX, s_dot: ca.SX) -> ca.SX:
    """The matrix of Christoffel's symbols in Kronecker layout, for which M' - 2 C is skew.

        C(s, s') = 1/2 [dM/ds (I (x) s') + dM/ds (s' (x) I) - (dM/ds (s' (x) I))^T]

    Parameters: M: (n, n); s, s_dot: (n, 1). Returns: (n, n).
    Source: Khang, Dat, Tuan (2019), property (19), with the symmetry of M.
    """
    dM, eye = derivative(M, s), ca.DM.eye(s.numel())
    along = dM @ ca.kron(eye, s_dot)
    across = dM @ ca.kron(s_dot, eye)
    return (along + across - across.T) / 2
