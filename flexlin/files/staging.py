"""Folders in which results are made before they take their place, and what is left of those whose program was killed."""

import hashlib
import os
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from flexlin.files.disk import alone, fcntl, hold, let_go
from flexlin.files.manifest import MANIFEST, read_manifest

MARK, PART, WHOLE = ".flexlin-", ".part", ".whole"
"""`.NAME.flexlin-UNIQUE.part` is being written; `.whole` holds a whole set, whose files are on their way to their places."""
INNER = "set"
"""The folder in it that has the files; the outer one is held by its writer."""
LONGEST = 120
"""Bytes of a name that are kept; the marks need room beside it."""
OLD = 86_400.0
"""Seconds after which a folder counts as left behind where the system does not say."""


def prefix_for(name: str) -> str:
    """How the staging folders of a file or folder of this name begin."""
    raw = os.fsencode(name)
    return f".{name if len(raw) <= LONGEST else hashlib.sha256(raw).hexdigest()[:32]}{MARK}"


def staged(place: Path, name: str, ending: str) -> list[Path]:
    """The staging folders for `name` in a place, in the order of their names."""
    prefix = prefix_for(name)
    try:
        with os.scandir(place) as entries:
            found = [entry for entry in entries if entry.name.startswith(prefix) and entry.name.endswith(ending)]
            return sorted(Path(entry.path) for entry in found if is_mine(entry))
    except OSError:
        return []


def is_mine(entry: os.DirEntry[str]) -> bool:
    """Whether it is a folder of this user: what others put beside the results is none of ours."""
    return entry.is_dir(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_uid == user()


def user() -> int:
    """The user that owns what this process writes; 0 for all where there are none."""
    return os.geteuid() if hasattr(os, "geteuid") else 0


@contextmanager
def staging(place: Path, target: Path) -> Iterator[Path]:
    """Give a new folder in `place` in which results for `target` are made; it is gone when the block ends, however it ends.

    What killed programs left for the same target is taken away first. The name is unique among threads and processes, and the folder is
    held as long as it is written to, so that nobody else takes it for left behind.
    """
    with alone(place):
        take_away_left(place, target)
        folder = place / f"{prefix_for(target.name)}{os.getpid()}-{secrets.token_hex(6)}{PART}"
        folder.mkdir()
        handle = hold(folder)
    try:
        (folder / INNER).mkdir()
        yield folder / INNER
    finally:
        try:
            discard(folder, target)
        finally:
            let_go(handle)


def take_away_left(place: Path, target: Path) -> None:
    """Take away what killed programs left in a place for a target; the place is held."""
    for left in staged(place, target.name, PART):
        if is_left_behind(left):
            discard(left, target)


def is_left_behind(folder: Path) -> bool:
    """Whether nobody writes to a staging folder any more."""
    try:
        handle = hold(folder)
    except BlockingIOError:
        return False
    let_go(handle)
    try:
        return fcntl is not None or time.time() - folder.stat().st_mtime > OLD
    except OSError:
        return False


def discard(folder: Path, target: Path) -> None:
    """Take a staging folder away. Where it is the old folder of results, whatever came into it from elsewhere moves on to the new one."""
    inner = folder / INNER
    manifest = read_manifest(inner)
    if manifest.sets:
        known = {MANIFEST, *(name.partition("/")[0] for name in manifest.files)}
        with suppress(FileNotFoundError):  # somebody else is at it
            for entry in inner.iterdir():
                if entry.name not in known and not os.path.lexists(target / entry.name):
                    os.rename(entry, target / entry.name)
    shutil.rmtree(folder, ignore_errors=True)
