"""LAPACK as SciPy wraps it, for what is called so often that SciPy's checks would take longer than the work."""

import numpy as np
import scipy.linalg

from flexlin.checks import Array

LAPACK = scipy.linalg.lapack
ROOM = 64
"""Numbers of work space for each row, as LAPACK's blocks of 64 ask for."""


def complex_schur(A: Array) -> tuple[Array, Array]:
    """T upper triangular and Z unitary (n, n) with A = Z T Z^H, by zgees.

    Raises: ValueError where A is not finite; LinAlgError where the eigenvalues are not found.
    """
    T, _, _, Z, _, failed = LAPACK.zgees(lambda value: False, np.asarray_chkfinite(A, complex), lwork=ROOM * len(A))
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of a Schur form are not found")
    return T, Z
