"""The compiled code that analyses use, made before any time is counted: on a new machine it takes some seconds, once."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from flexlin.compiler import find_kept_library, is_missing
from flexlin.periodic.quadratic import backward

KERNELS = (backward.FILES,)
"""The C files of each library."""


def find_missing() -> list[tuple[Path, ...]]:
    """The libraries that have to be compiled here, and can be kept."""
    return [files for files in KERNELS if is_missing(*files)]


def compile_kernels() -> None:
    """Compile what is missing, side by side; where that fails, NumPy does the work."""
    if missing := find_missing():
        with ThreadPoolExecutor(len(missing)) as pool:
            list(pool.map(lambda files: find_kept_library(*files), missing))
