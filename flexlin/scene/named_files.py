"""Where the files lie that a scene names: below its own folder, or below one that the user has named."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flexlin.errors import Problem
from flexlin.text import printable


def place_motion_file(data: dict[str, Any], folders: Sequence[Path]) -> list[Problem]:
    """Make the name of the motion's file absolute: the first of the folders that has it.

    A name that leads out of all of them, by .. or by a link, is a problem, whether there is such a file or not.
    """
    motion = data.get("motion")
    if not isinstance(motion, dict) or not isinstance(motion.get("file"), str):
        return []
    name = motion["file"]
    try:
        below = [path for folder in folders if (path := place_below(folder.resolve(), name)) is not None]
        found = next((path for path in below if path.exists()), below[0] if below else None)
    except (OSError, ValueError, RuntimeError):  # a null character, a loop of links
        return [Problem("motion.file", printable(repr(name)), "the name of a CSV file")]
    if found is None:
        expected = "a file below the scene's folder, or below a folder that you name (--data DIR)"
        return [Problem("motion.file", printable(repr(name)), expected)]
    motion["file"] = str(found)
    return []


def place_below(folder: Path, name: str) -> Path | None:
    """The place of a file, links followed; None where it is not below the folder."""
    path = (folder / name).resolve()
    return path if folder in path.parents else None
