"""What the user writes: frozen tables, TOML loading, overrides."""

from importlib import import_module
from typing import Any

_HOME = {
    "Scene": "flexlin.scene.scene",
    "builtin_scenes": "flexlin.scene.library",
    "load_scene": "flexlin.scene.loading",
    "parse_scene": "flexlin.scene.loading",
    "register_model": "flexlin.scene.library",
    "scene_schema": "flexlin.scene.json_schema",
    "scenes": "flexlin.scene.library",
}
"""Where each public name stands; its module is loaded when it is first used."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'flexlin.scene' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
