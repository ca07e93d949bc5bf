"""The compiled code of decoupling: compiled once, kept for later processes, and found again by them."""

import ctypes
from functools import lru_cache
from pathlib import Path

from flexlin.compiler import find_compiler, find_kept_folder, load_library
from flexlin.errors import NumericalError


@lru_cache(maxsize=1)
def find_library() -> ctypes.CDLL | None:
    """The library of steady.c; none where it cannot be compiled, or would have to be by every process."""
    if find_compiler() is None or find_kept_folder() is None:
        return None
    try:
        return load_library(Path(__file__).with_name("steady.c").read_text(encoding="utf-8"))
    except (NumericalError, OSError):
        return None
