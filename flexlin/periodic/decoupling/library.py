"""The compiled code of decoupling: compiled once, kept for later processes, and found again by them."""

import ctypes
from functools import lru_cache
from importlib.resources import files

from flexlin.errors import NumericalError
from flexlin.periodic.compiler import find_compiler, find_kept_folder, load_library


@lru_cache(maxsize=1)
def find_library() -> ctypes.CDLL | None:
    """The library of steady.c; none where it cannot be compiled, or would have to be by every process."""
    if find_compiler() is None or find_kept_folder() is None:
        return None
    try:
        return load_library(files("flexlin.periodic.decoupling").joinpath("steady.c").read_text(encoding="utf-8"))
    except (NumericalError, OSError):
        return None
