"""`flexlin schema`: print the JSON schema of scenes, from which editors complete and check."""

import argparse

from flexlin.cli.shared import DONE

PURPOSE = "print the JSON schema of scenes, with descriptions and units"
TAKES = ()


def run(options: argparse.Namespace) -> int:
    import json

    from flexlin.scene.json_schema import scene_schema

    print(json.dumps(scene_schema(), indent=1, ensure_ascii=False))
    return DONE
