"""Blocks of a sweep shared out among threads, processes, or the workers of a Dask cluster, by executors with one interface."""

import os
import pickle
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from itertools import islice
from threading import Event, get_ident
from typing import IO, Any
from urllib.parse import urlsplit

from flexlin.analyses.sweep.found import FAILED, Found
from flexlin.checks import Array
from flexlin.errors import ArgumentError, NumericalError
from flexlin.resources import listening

Job = Any
"""A `Job` of `sweep.job`, which asks for what is here: its points, its blocks that are not done, its work and what is found."""
BLOCKS_AHEAD = 4
"""Blocks for each worker that are given out at once: on a cluster they wait where they are computed."""
BLOCK_ATTEMPTS = 3
"""Times that a block is tried before it is given up as what kills the processes."""
ENDED = "the process that computed it ended, three times"
SCHEDULER_SECONDS = 10.0
"""Seconds in which a scheduler must answer."""


def share(job: Job, submit: Callable[[Array], "Future[Found]"], workers: int) -> Iterator[tuple[int, Found]]:
    """Finished blocks, as they come. Raises: what a block raised."""
    blocks, pending = iter(job.blocks), dict[Future[Found], int]()
    try:
        while True:
            for start, stop in islice(blocks, BLOCKS_AHEAD * workers - len(pending)):
                pending[submit(job.points[start:stop])] = start
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                yield pending.pop(future), future.result()
    finally:
        for future in pending:
            future.cancel()


def share_among_threads(job: Job, workers: int) -> Iterator[tuple[int, Found]]:
    """For compiled work, which does not hold the interpreter's lock: nothing is started or copied, so it pays for short work too.

    What is still at work when nobody waits any more ends at its next value.
    """
    unwanted = Event()

    def end_early(_: float) -> None:
        if unwanted.is_set():
            raise CancelledError

    def compute(points: Array) -> Found:
        with listening(end_early):
            return job.work.compute(points)

    with ThreadPoolExecutor(workers) as pool:
        try:
            yield from share(job, lambda points: pool.submit(compute, points), workers)
        finally:
            unwanted.set()


def share_among_processes(job: Job, workers: int) -> Iterator[tuple[int, Found]]:
    """Each thread has a process of this machine that works for it."""
    crew = Crew(pickle.dumps(job.work, protocol=pickle.HIGHEST_PROTOCOL), job.found.exponents.shape[1])
    with ThreadPoolExecutor(workers) as pool:
        try:
            yield from share(job, lambda points: pool.submit(crew.compute, points), workers)
        finally:
            crew.close()


def share_on_cluster(job: Job, client: Any) -> Iterator[tuple[int, Found]]:
    """On an existing cluster, by a `distributed.Client` or its scheduler's address; a block whose worker dies goes to another one."""
    with connect(client) as known:
        from distributed import KilledWorker

        work = known.scatter(job.work, broadcast=True, hash=False)
        pool = known.get_executor(pure=False, retries=BLOCK_ATTEMPTS)
        try:
            threads = max(1, sum(known.nthreads().values()))
            yield from share(job, lambda points: pool.submit(type(job.work).compute, work, points.copy()), threads)
        except KilledWorker as error:
            todo = "give the workers more memory, or ask for fewer values"
            raise NumericalError("workers died over a block", got=str(error)[:200], todo=todo) from None
        finally:
            pool.shutdown(wait=False)


@contextmanager
def connect(client: Any) -> Iterator[Any]:
    """A `distributed.Client`: the one that is given, or one of the scheduler at an address. Raises: ArgumentError."""
    try:
        from distributed import Client
    except ImportError:
        todo = "pip install flexlin[cluster]"
        raise ArgumentError("Dask is not installed", got="no module distributed", todo=todo) from None
    if isinstance(client, Client):
        yield client
        return
    if not isinstance(client, str):
        expected = "a distributed.Client, or the address of a scheduler"
        raise ArgumentError("client is of another kind", got=repr(client)[:80], expected=expected)
    try:
        refuse_silence(client)
        known = Client(client, timeout=SCHEDULER_SECONDS)
    except (OSError, ValueError, TimeoutError) as error:
        todo = "start one: dask scheduler, and dask worker ADDRESS on each machine"
        raise ArgumentError("no scheduler answers", got=f"{client}: {str(error)[:120]}", todo=todo) from None
    with known:
        yield known


def refuse_silence(address: str) -> None:
    """Raise OSError or ValueError where nobody listens; Dask's client, on a busy machine, may then wait without end."""
    place = urlsplit(address if "://" in address else f"tcp://{address}")
    if place.scheme in ("tcp", "tls"):
        socket.create_connection((place.hostname, place.port or 8786), SCHEDULER_SECONDS).close()


class Crew:
    """A process for each thread that asks for pickled work, started when it is first needed; one that dies is replaced, and its block is
    tried again."""

    def __init__(self, work: bytes, states: int):
        self._work, self._states, self._closed = work, states, False
        self._processes = dict[int, "subprocess.Popen[bytes]"]()

    def compute(self, points: Array) -> Found:
        """A block, by the thread's own process. Raises: what the block raised there."""
        answer = None
        for _ in range(BLOCK_ATTEMPTS):
            with suppress(EOFError, OSError, pickle.UnpicklingError):
                process = self._processes.get(get_ident()) or self._start()
                send(process.stdin, points)  # type: ignore[arg-type]
                answer = pickle.load(process.stdout)  # type: ignore[arg-type]
                break
            self._end(get_ident())
        if isinstance(answer, Exception):
            raise answer
        if answer is None:
            answer = Found.empty(len(points), self._states)
            answer.verdict[:], answer.reason[:] = FAILED, ENDED
        return answer

    def close(self) -> None:
        """End the processes for good; what they were asked is lost."""
        self._closed = True
        for thread in list(self._processes):
            self._end(thread)

    def _start(self) -> "subprocess.Popen[bytes]":
        """A process that has its work. Raises: EOFError where no more are wanted."""
        if self._closed:
            raise EOFError
        command = [sys.executable, "-c", "from flexlin.analyses.sweep.sharing import serve; serve()"]
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, env=environment(), start_new_session=True)
        self._processes[get_ident()] = process
        if self._closed:  # meanwhile
            process.kill()
        send(process.stdin, self._work)  # type: ignore[arg-type]
        return process

    def _end(self, thread: int) -> None:
        if process := self._processes.pop(thread, None):
            process.kill()
            with suppress(OSError), process:  # what was not yet sent has nowhere to go
                pass


def environment() -> dict[str, str]:
    """The environment of a worker: it finds the same modules, and its linear algebra keeps to one thread."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **threads, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}


def send(stream: IO[bytes], message: Any) -> None:
    """Write one message."""
    pickle.dump(message, stream, protocol=pickle.HIGHEST_PROTOCOL)
    stream.flush()


def serve() -> None:
    """What a fresh interpreter does: take the work, and answer until the other side is gone; errors are sent back and raised there."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    answers, asked = os.fdopen(os.dup(sys.stdout.fileno()), "wb"), sys.stdin.buffer
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what is printed does not come between
    with suppress(EOFError, BrokenPipeError):
        work = pickle.loads(pickle.load(asked))
        while True:
            points = pickle.load(asked)
            try:
                answer = work.compute(points)
            except Exception as error:
                answer = error
            send(answers, answer)
