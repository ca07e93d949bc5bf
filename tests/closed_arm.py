"""The linearization of a built-in scene's arm under its own control law."""

from pathlib import Path
from typing import Any

import flexlin as fl


def closed(
    name: str = "single-link", changes: dict[str, Any] | None = None, folder: Path | None = None
) -> fl.Linearization:
    """Load, build and linearize; folder: of the files that the changes name."""
    scene = fl.load_scene(name, changes or {}, folder)
    return fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
