"""Reads a folder of results as somebody would who knows docs/results.md and nothing of flexlin's code."""

import hashlib
import json
from pathlib import Path


def standing(folder: Path, name: str) -> dict[str, bytes] | None:
    """The files of a set by name, where each has the checksum that the manifest states; None where one has another."""
    manifest = folder / "flexlin-results.json"
    if not manifest.exists():
        return {}
    stated = json.loads(manifest.read_text())["sets"].get(name, {"sha256": {}})["sha256"]
    found = {path: (folder / path).read_bytes() for path in stated if (folder / path).is_file()}
    whole = found.keys() == stated.keys() and all(hashlib.sha256(found[p]).hexdigest() == stated[p] for p in stated)
    return found if whole else None


def leftovers(folder: Path) -> list[str]:
    """Whatever bears the mark of a set in the making, in the folder, below it and beside it."""
    return sorted(str(path) for path in {*folder.parent.rglob("*flexlin-*")} if path.name != "flexlin-results.json")


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def interrupt(path: Path) -> None:
    """Ctrl-C when half a file is written."""
    path.write_text("half")
    raise KeyboardInterrupt
