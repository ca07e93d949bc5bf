"""Whether a folder can take results, asked before any work is done."""

import os
from pathlib import Path

from flexlin.errors import OutputError
from flexlin.text import printable


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to, before any work is done; nothing is created.

    Raises: OutputError.
    """
    try:
        existing = folder.resolve()
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
    except (OSError, RuntimeError) as error:  # a name that is too long, a loop of links
        got = getattr(error, "strerror", None) or "a loop of links"
        raise OutputError(f"{printable(folder)} cannot be the output folder", got=got, expected="a folder") from None
    if not existing.is_dir():
        raise OutputError(f"{folder} cannot be the output folder", got=f"{existing}, a file", expected="a folder")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise OutputError(
            f"{folder} cannot be the output folder",
            got=f"{existing} without permission to write",
            expected="a folder of yours",
        )
