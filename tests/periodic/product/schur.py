"""The periodic Schur form as the compiled code makes it, which nothing else asks for alone."""

import numpy as np

from flexlin._core import Function
from flexlin.lapack import find_routines
from flexlin.periodic.product import ROUTINES

PROTOTYPE = (
    "int find_periodic_schur(int n, int count, const double *factors, const double *start, const void *lapack, double complex *Q, "
    "double complex *T, double complex *turn, double complex *logs, double *end, double *defect)"
)


def periodic_schur(factors):
    """F_k Q_k = Q_(k+1) T_k, Q_K = Q_0 diag(turn): Q (K + 1, n, n) unitary, T (K, n, n) upper triangular, turn (n,)."""
    K, n = factors.shape[:2]
    Q, T, turn, logs = (np.empty(shape, complex) for shape in ((K + 1, n, n), (K, n, n), n, n))
    call = Function(PROTOTYPE, None, ("start",))
    assert not call(
        n,
        K,
        np.ascontiguousarray(factors),
        None,
        find_routines(*ROUTINES),
        Q,
        T,
        turn,
        logs,
        np.empty((n, n)),
        np.empty(1),
    )
    return Q, T, turn
