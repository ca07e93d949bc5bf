"""What the operating system gives: to disk at once, one folder in the place of another, one writer at a time."""

import ctypes
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

PATIENCE = 60.0
"""Seconds that a writer waits for another one, which holds a place only while it renames."""
PAUSE = 0.005
AT_CWD, EXCHANGE = -100, 2
"""Constants of Linux's renameat2."""


def sync(path: Path) -> None:
    """Have a file, or the entries of a folder, on the disk before anything else is done.

    Raises: OSError, also where the disk is full only now.
    """
    if path.is_dir():
        if os.name == "nt":  # its folders cannot be opened
            return
        handle = os.open(path, os.O_RDONLY)
    else:
        handle = os.open(path, os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sync_all(folder: Path) -> None:
    """Have a folder with all that is in it on the disk."""
    for path in folder.rglob("*"):
        sync(path)
    sync(folder)


def exchange(one: Path, other: Path) -> bool:
    """Let two folders change their names in one step; False where the system or the file system has no such step.

    Source: renameat2(2) with RENAME_EXCHANGE, of Linux.
    """
    rename = getattr(ctypes.CDLL(None), "renameat2", None) if os.name == "posix" else None
    return rename is not None and rename(AT_CWD, os.fsencode(one), AT_CWD, os.fsencode(other), EXCHANGE) == 0


def hold(folder: Path) -> int | None:
    """Mark a folder as in use, until the handle that is returned is closed or its process ends; None where that cannot be marked.

    Raises: BlockingIOError where somebody else holds it.
    """
    if fcntl is None:
        return None
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise
    except OSError:  # a file system without locks
        os.close(handle)
        return None
    return handle


def let_go(handle: int | None) -> None:
    """Take the mark off."""
    if handle is not None:
        os.close(handle)


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Be the only writer of flexlin's in a folder, among threads and processes.

    Raises: OSError where another one does not let go.
    """
    until = time.monotonic() + PATIENCE
    while True:
        try:
            handle = hold(folder)
            break
        except BlockingIOError:
            if time.monotonic() > until:
                raise OSError(f"another program has held {folder} for {PATIENCE:g} s") from None
            time.sleep(PAUSE)
    try:
        yield
    finally:
        let_go(handle)
