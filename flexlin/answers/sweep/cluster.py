"""Blocks shared out among the workers of a Dask cluster."""

from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.job import Job
from flexlin.answers.sweep.task import compute_blocks
from flexlin.errors import ArgumentError, NumericalError

RETRIES = 3
"""Times that the cluster tries a block again."""
PATIENCE = 10.0
"""Seconds in which a scheduler must answer."""
AHEAD, MOST = 4, 8
"""Tasks for each thread of the cluster that wait there, and blocks of a task: fewer towards the end. A task costs the cluster 5 ms."""


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

        blocks, capacity = deque(job.blocks), self._capacity()
        work = self.client.scatter(job.work, broadcast=True, hash=False)
        pending: dict[Any, list[int]] = {}

        def submit() -> list[Any]:
            some = [blocks.popleft() for _ in range(min(MOST, -(-len(blocks) // capacity)))]
            if not some:
                return []
            points = [job.points[start:stop].copy() for start, stop in some]
            future = self.client.submit(compute_blocks, work, points, pure=False, retries=RETRIES)
            pending[future] = [start for start, _ in some]
            return [future]

        waiting = as_completed([future for _ in range(capacity) for future in submit()])
        try:
            for future in waiting:
                starts = pending.pop(future)
                try:
                    yield from zip(starts, future.result(), strict=True)
                except KilledWorker as error:
                    todo = "give the workers more memory, or ask for fewer values"
                    raise NumericalError("workers died over a block", got=str(error)[:200], todo=todo) from None
                future.release()
                for following in submit():
                    waiting.add(following)
        finally:
            with suppress(Exception):
                self.client.cancel(list(pending))
            if self._own:
                self.client.close()

    def _capacity(self) -> int:
        """Tasks that are given out at once."""
        return max(1, AHEAD * sum(self.client.nthreads().values()))
