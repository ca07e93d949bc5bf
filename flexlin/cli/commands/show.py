"""`flexlin show`: print a built-in scene, or one of your own, as it stands in its file."""

import argparse

from flexlin.cli.shared import DONE

PURPOSE = "print a scene as it stands in its file"
TAKES = ("scene",)


def run(options: argparse.Namespace) -> int:
    from flexlin.scene.loading import scene_text

    print(scene_text(options.scene), end="")
    return DONE
