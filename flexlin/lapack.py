"""LAPACK as SciPy wraps it, without the rest of `scipy.linalg`, which takes as long to load as all of NumPy."""

import sys
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from flexlin.checks import Array

WRAPPED = "scipy.linalg._flapack"
"""The compiled module that `scipy.linalg.lapack` hands on; where SciPy keeps it elsewhere, all of `scipy.linalg` is loaded."""
ROOM = 64
"""Numbers of work space for each row, as LAPACK's blocks of 64 ask for."""


def find_lapack() -> Any:
    """The wrappers of LAPACK, and of no more where SciPy keeps them in a module of their own; `scipy.linalg` then takes the same ones."""
    if WRAPPED in sys.modules:
        return sys.modules[WRAPPED]
    spec = PathFinder.find_spec(WRAPPED, [str(Path(place, "linalg")) for place in scipy.__path__])
    if spec is None or spec.loader is None:
        from scipy.linalg import lapack

        return lapack
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return sys.modules.setdefault(WRAPPED, module)


LAPACK = find_lapack()


def complex_schur(A: Array) -> tuple[Array, Array]:
    """T upper triangular and Z unitary (n, n) with A = Z T Z^H, by zgees.

    Raises: ValueError where A is not finite; LinAlgError where the eigenvalues are not found.
    """
    T, _, _, Z, _, failed = LAPACK.zgees(lambda value: False, np.asarray_chkfinite(A, complex), lwork=ROOM * len(A))
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of a Schur form are not found")
    return T, Z


def symmetric_pencil(A: Array, B: Array) -> tuple[Array, Array]:
    """Rising eigenvalues (n,) and vectors (n, n) of A x = lambda B x, A symmetric and B positive definite, by dsygvd: V' B V = I.

    Raises: ValueError where a number is not finite; LinAlgError where B is not positive definite, or the eigenvalues are not found.
    """
    values, vectors, failed = LAPACK.dsygvd(np.asarray_chkfinite(A), np.asarray_chkfinite(B), uplo="L")
    if failed:
        raise np.linalg.LinAlgError("a matrix of a pencil is not positive definite")
    return values, vectors
