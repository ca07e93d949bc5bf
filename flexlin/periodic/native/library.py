"""The compiled code of the numeric wing: compiled once, kept for later processes, and found again by them."""

import ctypes
from functools import lru_cache
from pathlib import Path

from flexlin.compiler import find_kept_library

SOURCES = (
    "fit",
    "vectors",
    "elimination",
    "factors",
    "magnus",
    "sylvester",
    "sweep",
    "accelerations",
    "checking",
)
FILES = tuple(Path(__file__).with_name(f"{name}.c") for name in SOURCES)
WHOLE, LONG, REAL, ADDRESS = ctypes.c_int, ctypes.c_long, ctypes.c_double, ctypes.c_void_p
ARGUMENTS = {
    "fit_series": [ADDRESS] * 8,
    "find_sizes": [LONG, WHOLE] + [ADDRESS] * 2,
    "compare_series": [LONG] + [WHOLE] * 2 + [ADDRESS] * 5,
    "factor_magnus": [WHOLE] * 2 + [ADDRESS] + [WHOLE] * 2 + [REAL, ADDRESS],
    "solve_against_scalars": [WHOLE] * 5 + [ADDRESS] * 3,
    "solve_between_groups": [WHOLE] * 6 + [ADDRESS] * 2,
    "sweep_factors": [WHOLE] * 3 + [ADDRESS] * 3,
    "factor_accelerations": [WHOLE] * 3 + [ADDRESS] * 5,
}
"""What the functions of the library take."""


@lru_cache(maxsize=1)
def find_library() -> ctypes.CDLL | None:
    """The library of the sources; none where there is no compiler."""
    library = find_kept_library(*FILES)
    if library is not None:
        for name, kinds in ARGUMENTS.items():
            getattr(library, name).argtypes = kinds
    return library
