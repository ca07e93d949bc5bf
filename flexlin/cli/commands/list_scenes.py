"""`flexlin list`: name the scenes that travel with flexlin."""

import argparse

from flexlin.cli.shared import DONE

PURPOSE = "name the scenes that travel with flexlin"
TAKES = ()


def run(options: argparse.Namespace) -> int:
    import tomllib

    from flexlin.scene.library import builtin_scenes

    for name, path in builtin_scenes().items():
        print(f"{name:<24} {tomllib.loads(path.read_text(encoding='utf-8'))['title']}")
    return DONE
