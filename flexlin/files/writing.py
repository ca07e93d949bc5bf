"""The doors for results: a set of files, or a single one, appears whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from flexlin.bounds import printable
from flexlin.errors import OutputError
from flexlin.files.disk import alone, sync
from flexlin.files.switch import may_be_missed, staging, switch, take_away_left


@dataclass(frozen=True)
class Results:
    """A set in the making: `stage` is where its files are written; `folder` is where they will stand."""

    folder: Path
    stage: Path

    def __truediv__(self, name: str) -> Path:
        """Where a file of the set is written."""
        return self.stage / name

    def placed(self, *names: str) -> list[Path]:
        """Where files of the set will stand."""
        return [self.folder / name for name in names]


@contextmanager
def results(folder: Path, name: str) -> Iterator[Results]:
    """Let the block write a set of results into an empty folder; when it ends well the set stands in `folder`, else nothing has changed.

    A reader finds the old set or the new one: `docs/results.md`. Of several writers the last whole set stands.
    Parameters: name: of the set; what bore it before is replaced.
    Raises: OutputError where the folder or its files cannot be written.
    """
    try:
        target = folder.resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        with staging(place_for(target), target) as stage:
            yield Results(folder, stage)
            switch(stage, target, name)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written", got=error.strerror or str(error)) from None


def place_for(target: Path) -> Path:
    """Where results for a folder are made: beside it, so that one rename is enough; inside it where that cannot be, or may be missed."""
    beside = target.parent
    if not target.exists():
        return beside
    one_device = beside.stat().st_dev == target.stat().st_dev
    return beside if one_device and os.access(beside, os.W_OK | os.X_OK) and not may_be_missed(target) else target


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path of the same name elsewhere; when the block ends well the file that it wrote becomes `path`, else it vanishes.

    Raises: OutputError when the folder cannot be made or the file not be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with staging(path.parent, path) as stage:
            yield stage / path.name
            sync(stage / path.name)
            with alone(path.parent):
                os.replace(stage / path.name, path)
            sync(path.parent)
    except OSError as error:
        raise OutputError(f"{path} cannot be written", got=error.strerror or str(error)) from None


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def clear_left(path: Path) -> None:
    """Take away what killed programs left beside a file, where that can be done."""
    with suppress(OSError), alone(path.parent):
        take_away_left(path.parent, path)


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to, before any work is done; nothing is created.

    Raises: OutputError.
    """
    try:
        existing = folder.resolve()
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
    except (OSError, RuntimeError, ValueError) as error:  # a name that is too long, a loop of links, a zero in a name
        got = getattr(error, "strerror", None) or ("a loop of links" if isinstance(error, RuntimeError) else str(error))
        raise OutputError(f"{printable(folder)} cannot be the output folder", got=got, expected="a folder") from None
    if not existing.is_dir():
        raise OutputError(f"{folder} cannot be the output folder", got=f"{existing}, a file", expected="a folder")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise OutputError(
            f"{folder} cannot be the output folder",
            got=f"{existing} without permission to write",
            expected="a folder of yours",
        )
