"""The linearization of a built-in scene's arm under its own control law."""

from typing import Any

import flexlin as fl


def closed(name: str = "single-link", changes: dict[str, Any] | None = None) -> fl.Linearization:
    """Load, build and linearize."""
    scene = fl.load_scene(name, changes or {})
    return fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
