"""A scene with other numbers, checked anew as if it were read from a file."""

from collections.abc import Mapping
from typing import Any

from flexlin.scene.library import registered_model
from flexlin.scene.loading import checked_table, parse_scene
from flexlin.scene.parameters import PARAMETERS, get_value, whole_path
from flexlin.scene.scene import Scene


def raw_tables(scene: Scene) -> dict[str, Any]:
    """The scene as plain data, only what was written into it: `parse_scene` makes the same scene of it."""
    return scene.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_unset=True)


def revise_scene(scene: Scene, values: Mapping[str, float], raw: Mapping[str, Any] | None = None) -> Scene:
    """The scene with other numbers at dotted paths.

    Parameters: raw: its `raw_tables`, where many revisions are made.
    Raises: SceneError with the key of each number that is refused, a registered model's own too.
    """
    raw = raw_tables(scene) if raw is None else raw
    revised = parse_scene(raw, scene.title, write_out_lists(scene, values, raw))
    if revised.model is not None:
        checked_table(registered_model(revised.model).schema, revised.parameters, scene.title, PARAMETERS)
    return revised


def write_out_lists(scene: Scene, values: Mapping[str, float], raw: Any) -> dict[str, Any]:
    """The values, those inside a list that was not written into the scene with the rest of the list, as the scene has it by default."""
    placed = dict[str, Any]()
    for path, value in values.items():
        whole, _, last = path.rpartition(".")
        if last.isdigit() and not is_written(raw, whole):
            items = placed.setdefault(whole, list(get_value(scene, whole)))
            items[int(last)] = value
        else:
            placed[path] = value
    return placed


def is_written(raw: Any, path: str) -> bool:
    """Whether plain data has something at a dotted path; a model's table may be left out of the path."""
    node = raw
    for step in whole_path(path, raw, raw.get(PARAMETERS)).split("."):
        if isinstance(node, list) and step.isdigit() and int(step) < len(node):
            node = node[int(step)]
        elif isinstance(node, dict) and step in node:
            node = node[step]
        else:
            return False
    return True
