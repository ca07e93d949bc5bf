"""Blocks shared out among the workers of a Dask cluster."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.job import Job, Work
from flexlin.checks import Array
from flexlin.errors import ArgumentError, NumericalError

RETRIES = 3
"""Times that the cluster tries a block again."""
PATIENCE = 10.0
"""Seconds in which a scheduler must answer."""
AHEAD = 8
"""Blocks for each thread of the cluster that wait there."""
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Options of glibc's mallopt (malloc.h)."""
KEPT, USUAL = 2**25, 2**17
"""Bytes from which memory is given back at once: during a block, and as glibc has it."""


class Cluster:
    """The workers of an existing cluster on one job: call it with the job. `client`: a `distributed.Client`, or a scheduler's address."""

    def __init__(self, client: Any):
        try:
            from distributed import Client
        except ImportError:
            todo = "pip install flexlin[cluster]"
            raise ArgumentError("Dask is not installed", got="no module distributed", todo=todo) from None
        self._own = not isinstance(client, Client)
        if self._own and not isinstance(client, str):
            expected = "a distributed.Client, or the address of a scheduler"
            raise ArgumentError("client is of another kind", got=repr(client)[:80], expected=expected)
        try:
            self.client = Client(client, timeout=PATIENCE) if self._own else client
        except (OSError, ValueError, TimeoutError) as error:
            got, todo = (
                f"{client}: {str(error)[:120]}",
                "start one: dask scheduler, and dask worker ADDRESS on each machine",
            )
            raise ArgumentError("no scheduler answers", got=got, todo=todo) from None

    def __call__(self, job: Job) -> Iterator[tuple[int, Found]]:
        """Finished blocks, as they come; a block whose worker dies goes to another one. Raises: what a block raised."""
        from distributed import KilledWorker, as_completed

        blocks = iter(job.blocks)
        work = self.client.scatter(job.work, broadcast=True, hash=False)
        pending: dict[Any, int] = {}

        def submit() -> list[Any]:
            for start, stop in blocks:
                points = job.points[start:stop].copy()
                future = self.client.submit(compute_block, work, points, pure=False, retries=RETRIES)
                pending[future] = start
                return [future]
            return []

        waiting = as_completed([future for _ in range(self._capacity()) for future in submit()])
        try:
            for future in waiting:
                start = pending.pop(future)
                try:
                    yield start, future.result()
                except KilledWorker as error:
                    todo = "give the workers more memory, or ask for fewer values"
                    raise NumericalError("workers died over a block", got=str(error)[:200], todo=todo) from None
                for following in submit():
                    waiting.add(following)
        finally:
            with suppress(Exception):
                self.client.cancel(list(pending))
            if self._own:
                self.client.close()

    def _capacity(self) -> int:
        """Blocks that are given out at once."""
        return max(1, AHEAD * sum(self.client.nthreads().values()))


def compute_block(work: Work, points: Array) -> Found:
    """One block, on the worker."""
    with keep_freed_memory():
        return work.compute(points)


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
