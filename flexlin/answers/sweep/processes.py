"""Blocks shared out among processes of this machine; one that dies is replaced, and its block is tried again."""

import os
import pickle
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from queue import SimpleQueue
from typing import IO, Any

from flexlin.answers.sweep.found import FAILED, Found
from flexlin.answers.sweep.job import Job
from flexlin.answers.sweep.worker import receive, send
from flexlin.checks import Array
from flexlin.errors import ArgumentError

ATTEMPTS = 3
"""Times that a block is tried before it is given up as what kills the processes."""
ENDED = "the process that computed it ended, three times"


class Worker:
    """One process, started when it is first needed and after it has ended; `work`: pickled."""

    def __init__(self, work: bytes):
        self._work = work
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    @property
    def streams(self) -> list[IO[bytes]]:
        """This side of the streams to the process, if there is one."""
        return [stream for stream in (self._process.stdin, self._process.stdout) if stream] if self._process else []

    def compute(self, points: Array) -> Any:
        """A block's answer, or the error that it raised. Raises: EOFError, OSError where the process has ended."""
        try:
            stdin, stdout = self._start()
            send(stdin, points)
            return receive(stdout)
        except (EOFError, OSError):
            self._end()
            raise

    def close(self) -> None:
        """End the process for good."""
        self._closed = True
        self._end()

    def _start(self) -> list[IO[bytes]]:
        """The streams to and from a process that can compute."""
        if self._closed:
            raise EOFError
        if self._process is None:
            command = [sys.executable, "-c", "from flexlin.answers.sweep.worker import serve; serve()"]
            pipe = subprocess.PIPE
            self._process = subprocess.Popen(
                command, stdin=pipe, stdout=pipe, env=environment(), start_new_session=True
            )
            send(self.streams[0], self._work)
        return self.streams

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for stream in (process.stdin, process.stdout):
                with suppress(OSError):  # what was not yet sent has nowhere to go
                    stream.close()  # type: ignore[union-attr]


class Processes:
    """Several workers on one job: call it with the job."""

    def __init__(self, workers: int):
        self.workers = workers

    def __call__(self, job: Job) -> Iterator[tuple[int, Found]]:
        """Finished blocks, as they come. Raises: what a block raised; ArgumentError where the work cannot be sent."""
        try:
            work = pickle.dumps(job.work, protocol=pickle.HIGHEST_PROTOCOL)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            todo = "ask for workers = 1"
            raise ArgumentError("the loop cannot be sent to other processes", got=str(error), todo=todo) from None
        todo_, answers = deque(job.blocks), SimpleQueue[Any]()
        left, crew = len(todo_), [Worker(work) for _ in range(min(self.workers, len(todo_)))]
        for worker in crew:
            threading.Thread(target=work_off, args=(worker, todo_, job, answers), daemon=True).start()
        try:
            for _ in range(left):
                start, answer = answers.get()
                if isinstance(answer, BaseException):
                    raise answer
                yield start, answer
        finally:
            todo_.clear()
            for worker in crew:
                worker.close()


def work_off(worker: Worker, todo: deque[tuple[int, int]], job: Job, answers: "SimpleQueue[Any]") -> None:
    """Let one worker do block after block; a block during which it ended is tried again by a new process."""
    while True:
        try:
            start, stop = todo.popleft()
        except IndexError:
            return
        for _ in range(ATTEMPTS):
            try:
                answers.put((start, worker.compute(job.points[start:stop])))
                break
            except (EOFError, OSError):
                continue
            except BaseException as error:  # the one who waits must hear of it
                answers.put((start, error))
                return
        else:
            answers.put((start, lost_block(stop - start, job)))


def lost_block(values: int, job: Job) -> Found:
    """A block that no process survives."""
    found = Found.empty(values, job.found.exponents.shape[1])
    found.verdict[:], found.reason[:] = FAILED, ENDED
    return found


def environment() -> dict[str, str]:
    """The environment of a worker: it finds the same modules, and its linear algebra keeps to one thread."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **threads, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
