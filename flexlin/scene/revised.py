"""A scene with other numbers, checked anew as if it were read from a file."""

from collections.abc import Mapping
from typing import Any

from flexlin.scene.library import registered_model
from flexlin.scene.loading import checked_table, parse_scene
from flexlin.scene.parameters import PARAMETERS
from flexlin.scene.scene import Scene


def raw_tables(scene: Scene) -> dict[str, Any]:
    """The scene as plain data, only what was written into it: `parse_scene` makes the same scene of it."""
    return scene.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_unset=True)


def revise_scene(scene: Scene, values: Mapping[str, float], raw: Mapping[str, Any] | None = None) -> Scene:
    """The scene with other numbers at dotted paths.

    Parameters: raw: its `raw_tables`, where many revisions are made.
    Raises: SceneError with the key of each number that is refused, a registered model's own too.
    """
    revised = parse_scene(raw_tables(scene) if raw is None else raw, scene.title, values)
    if revised.model is not None:
        checked_table(registered_model(revised.model).schema, revised.parameters, scene.title, PARAMETERS)
    return revised
