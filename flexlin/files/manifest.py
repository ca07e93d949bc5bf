"""Which files belong to which set of results, with their checksums, and what the operating system gives: locks, renames, to disk at once.

`flexlin-results.json` names them; what is read is a file of sane size.
"""

import ctypes
import fcntl
import hashlib
import json
import os
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from flexlin.bounds import LARGEST_MANIFEST

MANIFEST = "flexlin-results.json"
FORMAT = 1
Files = Mapping[str, str]
"""Names below the folder, parted by /, and their SHA-256."""


def read_text(path: Path, most: int) -> str:
    """Read a text file in UTF-8, with or without a byte order mark.

    A pipe or device is refused before it is opened, since it may never end.

    Parameters: most: bytes that it may have.
    Raises: OSError saying what is wrong with the file; UnicodeDecodeError (a ValueError).
    """
    refuse_odd(path.stat(), most)
    with path.open("rb") as file:
        refuse_odd(os.fstat(file.fileno()), most)  # another one may have come in its place
        content = file.read(most + 1)
    if len(content) > most:  # files of the system itself state no size
        raise OSError(f"it has more than {most:,} bytes")
    return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")


def refuse_odd(about: os.stat_result, most: int) -> None:
    """Refuse what is no regular file, or too large."""
    if not stat.S_ISREG(about.st_mode):
        raise OSError("it is no regular file")
    if about.st_size > most:
        raise OSError(f"it has {about.st_size:,} bytes, more than {most:,}")


@dataclass(frozen=True)
class Manifest:
    """The sets of a folder by name; no file belongs to two."""

    sets: Mapping[str, Files] = field(default_factory=dict)

    @property
    def files(self) -> dict[str, str]:
        """All files of all sets."""
        return {name: digest for files in self.sets.values() for name, digest in files.items()}

    def having(self, name: str, files: Files) -> "Manifest":
        """The manifest with a set in the place of what bore its name; files of other sets that it replaces become its own."""
        kept = {one: {path: has[path] for path in has if path not in files} for one, has in self.sets.items()}
        return Manifest({**{one: has for one, has in kept.items() if has and one != name}, name: files})

    def write(self, folder: Path) -> None:
        """Write it into a folder; it can be checked with sha256sum."""
        sets = {name: {"sha256": dict(sorted(files.items()))} for name, files in sorted(self.sets.items())}
        text = json.dumps({"format": FORMAT, "sets": sets}, indent=1)
        (folder / MANIFEST).write_text(text + "\n", encoding="utf-8")


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder; an empty one where there is none, or none that flexlin could have written."""
    try:
        data = json.loads(read_text(folder / MANIFEST, LARGEST_MANIFEST))
        known = Manifest({str(name): dict(one["sha256"]) for name, one in data["sets"].items()})
        sane = all(isinstance(digest, str) and stays_below(path) for path, digest in known.files.items())
        return known if sane and data["format"] == FORMAT else Manifest()
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Manifest()


def stays_below(name: str) -> bool:
    """Whether a name of a manifest leads to a place below its folder, whoever wrote it."""
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts and not set("\\:\0") & set(name)


def files_below(folder: Path) -> dict[str, Path]:
    """All that is no folder below a folder, by its name parted by /; the manifest is left out."""
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if not is_folder(path)}
    found.pop(MANIFEST, None)
    return found


def is_folder(path: Path) -> bool:
    """Whether it is a folder and no link to one."""
    return path.is_dir() and not path.is_symlink()


def has_digest(path: Path, digest: str | None) -> bool:
    """Whether a regular file has this content."""
    return path.is_file() and not path.is_symlink() and digest_of(path) == digest


def digest_of(path: Path) -> str:
    """The SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


PATIENCE = 60.0
"""Seconds that a writer waits for another one, which holds a place only while it renames."""


def sync(path: Path) -> None:
    """Have a file, or the entries of a folder, on the disk before anything else is done.

    Raises: OSError, also where the disk is full only now.
    """
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
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

    Source: renameat2(2) of Linux with AT_FDCWD = -100 and RENAME_EXCHANGE = 2.
    """
    rename = getattr(ctypes.CDLL(None), "renameat2", None)
    return rename is not None and rename(-100, os.fsencode(one), -100, os.fsencode(other), 2) == 0


def hold(folder: Path) -> int | None:
    """Mark a folder as in use, until the handle that is returned is closed or its process ends; None where that cannot be marked.

    Raises: BlockingIOError where somebody else holds it.
    """
    handle = None
    try:
        handle = os.open(folder, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:  # a file system without locks, or another's lock
        let_go(handle)
        if isinstance(error, BlockingIOError):
            raise
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
            time.sleep(0.005)
    try:
        yield
    finally:
        let_go(handle)
