"""What the user writes: frozen tables, TOML loading, overrides."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "scene.json_schema": "scene_schema",
        "scene.library": "builtin_scenes register_model scenes",
        "scene.loading": "load_scene parse_scene",
        "scene.scene": "Scene",
    },
    within={
        "scene.json_schema": "commented_scene write_toml",
        "scene.scene": "Accuracy",
        "scene.base": "NonNegative Positive Table Unit",
        "scene.control": "EstimatorTable Pd Weights",
        "scene.links": "CrossSection DIRECTIONS MATERIALS strip tube",
        "scene.effects": "effects_table known_effects",
        "scene.library": "models_folder",
        "scene.loading": "all_slide raw_tables revise_scene scene_text",
        "scene.motion": "AnyMotion Fourier Harmonic LogMotion PointToPoint Rotation TableMotion",
        "scene.names": "label_number name_unit",
        "scene.parameters": "apply_overrides get_value need_numbers numeric_paths parse_assignment replace_value",
        "scene.problems": "name_units",
        "scene.units": "dimension_of in_si in_unit",
        "scene.urdf.convert": "angles_of rotation_of scene_tables",
        "scene.urdf.robot": "read_robot",
    },
)
