"""What is read is a regular file of sane size."""

import stat
from pathlib import Path


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
