"""The linearization of a built-in scene's arm, under its own control law and without."""

from pathlib import Path
from typing import Any

import flexlin as fl


def closed(
    name: str = "single-link", changes: dict[str, Any] | None = None, folder: Path | None = None
) -> fl.Linearization:
    """Load, build and linearize; folder: of the files that the changes name."""
    return control_loop(fl.load_scene(name, changes or {}, folder))


def control_loop(scene: fl.Scene) -> fl.Linearization:
    """A scene's arm under its own law."""
    return fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)


def opened(name: str = "single-link", changes: dict[str, Any] | None = None) -> tuple[fl.Scene, fl.Linearization]:
    """The scene too, and its arm without a loop."""
    scene = fl.load_scene(name, changes or {})
    return scene, fl.linearize(fl.build_manipulator(scene), scene.motion)


def both(name: str, changes: dict[str, Any]) -> tuple[fl.Scene, fl.Linearization, fl.Linearization]:
    """The scene, and its arm without a loop and with it."""
    scene = fl.load_scene(name, changes)
    arm = fl.build_manipulator(scene)
    return scene, fl.linearize(arm, scene.motion), fl.linearize(arm, scene.motion, scene.control)
