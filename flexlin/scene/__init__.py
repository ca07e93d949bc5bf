"""What the user writes: frozen tables, TOML loading, overrides."""

from flexlin.scene.json_schema import scene_schema
from flexlin.scene.library import builtin_scenes, register_model, scenes
from flexlin.scene.loading import load_scene, parse_scene
from flexlin.scene.scene import Scene

__all__ = ["Scene", "builtin_scenes", "load_scene", "parse_scene", "register_model", "scene_schema", "scenes"]
