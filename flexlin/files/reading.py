"""What is read is a regular file of sane size."""

import os
import stat
from pathlib import Path


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
        raise OSError(f"it has more than {most} bytes")
    return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")


def refuse_odd(about: os.stat_result, most: int) -> None:
    """Refuse what is no regular file, or too large."""
    if not stat.S_ISREG(about.st_mode):
        raise OSError("it is no regular file")
    if about.st_size > most:
        raise OSError(f"it has {about.st_size} bytes, more than {most}")
