"""Some blocks of values on a worker of a cluster, which loads no more than the work asks for."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from flexlin.checks import Array

if TYPE_CHECKING:
    from flexlin.answers.sweep.found import Found
    from flexlin.answers.sweep.job import Work

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Options of glibc's mallopt (malloc.h)."""
KEPT, USUAL = 2**25, 2**17
"""Bytes from which memory is given back at once: during a block, and as glibc has it."""


def compute_blocks(work: "Work", blocks: list[Array]) -> "list[Found]":
    """Some blocks, on the worker."""
    with keep_freed_memory():
        return [work.compute(points) for points in blocks]


@contextmanager
def keep_freed_memory() -> Iterator[None]:
    """Let the C library keep what the block frees, for its next arrays, where Dask's nanny has set MALLOC_TRIM_THRESHOLD_ to 64 kB.

    Memory that goes back to the system comes anew with a fault and zeros a page: blocks would take 1.4 to 1.7 times as long.
    """
    low = os.environ.get("MALLOC_TRIM_THRESHOLD_", "")
    if sys.platform != "linux" or not low.isdecimal():
        yield
        return
    set_option = getattr(ctypes.CDLL(None), "mallopt", lambda *_: 0)  # not every C library has it
    for option in (TRIM_THRESHOLD, MMAP_THRESHOLD):
        set_option(option, KEPT)
    try:
        yield
    finally:
        set_option(TRIM_THRESHOLD, int(low))
        set_option(MMAP_THRESHOLD, USUAL)
