"""Blocks shared out among threads of this process: for compiled work, which does not hold the interpreter's lock."""

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.job import Job

AHEAD = 2
"""Blocks for each thread that are given out at once."""


class Threads:
    """Several threads on one job: call it with the job. Nothing is started, loaded or copied, so they pay for short work too."""

    def __init__(self, workers: int):
        self.workers = workers

    def __call__(self, job: Job) -> Iterator[tuple[int, Found]]:
        """Finished blocks, as they come. Raises: what a block raised."""
        blocks = iter(job.blocks)
        pending: dict[Future[Found], int] = {}
        pool = ThreadPoolExecutor(self.workers)

        def submit() -> None:
            for start, stop in blocks:
                pending[pool.submit(job.work.compute, job.points[start:stop])] = start
                return

        try:
            for _ in range(AHEAD * self.workers):
                submit()
            while pending:
                for future in wait(pending, return_when=FIRST_COMPLETED).done:
                    submit()
                    yield pending.pop(future), future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
