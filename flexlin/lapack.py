"""LAPACK as SciPy wraps it, for what is called so often that SciPy's checks would take longer than the work."""

import ctypes
from functools import cache

import numpy as np
import scipy.linalg
from scipy.linalg import cython_lapack

from flexlin.checks import Array

LAPACK = scipy.linalg.lapack
ROOM = 64
"""Numbers of work space for each row, as LAPACK's blocks of 64 ask for."""


@cache
def find_routines(*names: str) -> "ctypes.Array[ctypes.c_void_p]":
    """Where routines of LAPACK stand, for compiled code that calls them with 32-bit integers."""
    api, capsules = ctypes.pythonapi, [cython_lapack.__pyx_capi__[name] for name in names]
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    places = [api.PyCapsule_GetPointer(one, api.PyCapsule_GetName(one)) for one in capsules]
    return (ctypes.c_void_p * len(names))(*places)


def complex_schur(A: Array) -> tuple[Array, Array]:
    """T upper triangular and Z unitary (n, n) with A = Z T Z^H, by zgees.

    Raises: ValueError where A is not finite; LinAlgError where the eigenvalues are not found.
    """
    T, _, _, Z, _, failed = LAPACK.zgees(lambda value: False, np.asarray_chkfinite(A, complex), lwork=ROOM * len(A))
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of a Schur form are not found")
    return T, Z
