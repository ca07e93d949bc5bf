"""What the user writes: frozen tables, TOML loading, overrides."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "Scene": "flexlin.scene.scene",
        "builtin_scenes": "flexlin.scene.library",
        "load_scene": "flexlin.scene.loading",
        "parse_scene": "flexlin.scene.loading",
        "register_model": "flexlin.scene.library",
        "scene_schema": "flexlin.scene.json_schema",
        "scenes": "flexlin.scene.library",
    },
)
