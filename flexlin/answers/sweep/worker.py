"""A worker process: takes points, block after block, and sends back what it has computed.

A fresh interpreter takes the work and the points from its standard input and loads no script of the user's, on every operating system.
"""

import os
import pickle
import signal
import struct
import sys
from contextlib import suppress
from typing import IO, Any

SIZE = struct.Struct("<Q")


def send(stream: IO[bytes], message: Any) -> None:
    """Write one message."""
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(SIZE.pack(len(data)))
    stream.write(data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read one message. Raises: EOFError where the other side is gone."""
    head = stream.read(SIZE.size)
    if len(head) < SIZE.size:
        raise EOFError
    (size,) = SIZE.unpack(head)
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return pickle.loads(data)


def serve() -> None:
    """What a fresh interpreter does: take the work and answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    answers, asked = os.fdopen(os.dup(sys.stdout.fileno()), "wb"), sys.stdin.buffer
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what is printed does not come between
    with suppress(EOFError, BrokenPipeError):
        answer(pickle.loads(receive(asked)), asked, answers)


def answer(work: Any, asked: IO[bytes], answers: IO[bytes]) -> None:
    """Answer until the other side is gone; an error in a block is sent back and raised there."""
    with suppress(EOFError, BrokenPipeError):
        while True:
            points = receive(asked)
            try:
                send(answers, work.compute(points))
            except Exception as error:
                send(answers, error)
