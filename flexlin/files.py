"""Files appear whole or not at all: a temporary name in the same folder, then moved into place. What is read is a file of sane size."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from flexlin.errors import OutputError


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to, before any work is done; nothing is created.

    Raises: OutputError.
    """
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        raise OutputError(f"{folder} cannot be the output folder", got=f"{existing}, a file", expected="a folder")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise OutputError(
            f"{folder} cannot be the output folder",
            got=f"{existing} without permission to write",
            expected="a folder of yours",
        )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; when the block ends well it becomes `path`, else it vanishes.

    Raises: OutputError when the folder cannot be made or the file not be written.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield temporary
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path} cannot be written", got=error.strerror or str(error)) from None


@contextmanager
def replacing_folder(folder: Path) -> Iterator[Path]:
    """Give a temporary folder beside `folder`; when the block ends well its files move into `folder`, else it vanishes.

    Raises: OutputError as `replacing`.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder.parent) as temporary:
            yield Path(temporary)
            for file in Path(temporary).iterdir():
                os.replace(file, folder / file.name)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written", got=error.strerror or str(error)) from None


def read_text(path: Path, most: int) -> str:
    """Read a text file in UTF-8, with or without a byte order mark.

    A pipe or device is refused before it is opened, since it may never end.

    Parameters: most: bytes that it may have.
    Raises: OSError saying what is wrong with the file; UnicodeDecodeError (a ValueError).
    """
    about = path.stat()
    if not stat.S_ISREG(about.st_mode):
        raise OSError("it is no regular file")
    if about.st_size > most:
        raise OSError(f"it has {about.st_size} bytes, more than {most}")
    return path.read_text(encoding="utf-8-sig")


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
