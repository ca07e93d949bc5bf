"""`flexlin new`: write a scene of your own, with a comment beside every key."""

import argparse
from pathlib import Path

from flexlin.cli.shared import DONE, refuse_existing

PURPOSE = "write a commented scene to start from"
TAKES = ("name", "like")


def run(options: argparse.Namespace) -> int:
    import tomllib

    from flexlin.files import write_text
    from flexlin.scene.json_schema import commented_scene
    from flexlin.scene.loading import load_scene, parse_scene

    path = options.name if options.name.suffix == ".toml" else Path(f"{options.name}.toml")
    refuse_existing(path)
    data = load_scene(options.like).model_dump(mode="json", by_alias=True, exclude_unset=True)
    data["title"], text = path.stem, ""
    data.pop("source", None)
    text = commented_scene(data)
    parse_scene(tomllib.loads(text), str(path))
    write_text(path, text)
    print(f"wrote {path}, after {options.like}")
    print(f"next: flexlin check {path}; flexlin report {path}")
    return DONE
