"""The compiled code of the numeric wing: compiled once, kept for later processes, and found again by them."""

import ctypes
from functools import lru_cache
from pathlib import Path
from typing import Any

from flexlin.checks import Array
from flexlin.compiler import find_compiler, find_kept_folder, load_library
from flexlin.errors import NumericalError

SOURCES = (
    "fit",
    "blocks",
    "elimination",
    "rounds",
    "residual",
    "states",
    "rounding",
    "evidence",
    "factors",
    "group",
    "group_errors",
)
WHOLE, REAL, ADDRESS = ctypes.c_int, ctypes.c_double, ctypes.c_void_p
ARGUMENTS = {
    "fit_series": [WHOLE] * 3 + [REAL] + [ADDRESS] * 8,
    "sample_companion": [WHOLE] * 3 + [ADDRESS] * 3,
    "decouple_on_nodes": [WHOLE] * 7 + [REAL] + [ADDRESS] * 12,
    "follow_group": [WHOLE] * 5 + [ADDRESS] * 2 + [REAL] + [WHOLE] * 4 + [ADDRESS] * 4,
    "bound_group": [WHOLE] * 3 + [ADDRESS] * 7,
}
"""What the functions of the library take."""


@lru_cache(maxsize=1)
def find_library() -> ctypes.CDLL | None:
    """The library of the sources; none where they cannot be compiled, or would have to be by every process."""
    if find_compiler() is None or find_kept_folder() is None:
        return None
    try:
        library = load_library(
            "\n".join(Path(__file__).with_name(f"{name}.c").read_text(encoding="utf-8") for name in SOURCES)
        )
    except (NumericalError, OSError):
        return None
    for name, kinds in ARGUMENTS.items():
        getattr(library, name).argtypes = kinds
    return library


def address(array: Array) -> int:
    """Where the numbers of a contiguous array stand."""
    assert array.flags.c_contiguous
    if not array.flags.writeable:
        return int(array.ctypes.data)
    numbers: Any = array
    return ctypes.addressof(ctypes.c_char.from_buffer(numbers))
