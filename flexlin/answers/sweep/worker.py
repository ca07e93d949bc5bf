"""A worker process: takes points, block after block, and sends back what it has computed.

A fresh interpreter takes the work and the points from its standard input and loads no script of the user's, on every operating system.
"""

import os
import pickle
import signal
import sys
from contextlib import suppress
from typing import IO, Any


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
