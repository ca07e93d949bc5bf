"""`flexlin import`: write a scene of a robot from its URDF file."""

import argparse

from flexlin.cli.shared import DONE, refuse_existing

PURPOSE = "write a scene of a robot from its URDF file"
TAKES = ("robot", "file", "base", "tip")


def run(options: argparse.Namespace) -> int:
    from flexlin.files import write_text
    from flexlin.scene.loading import parse_scene
    from flexlin.scene.toml import write_toml
    from flexlin.scene.urdf import read_robot, scene_tables

    path = options.out
    refuse_existing(path)
    data = scene_tables(read_robot(options.robot), options.base, options.tip)
    scene = parse_scene(data, str(options.robot))
    write_text(path, write_toml(data))
    names = ", ".join(link.name for link in scene.links if link.moves)
    print(f"wrote {path}: joints {names}")
    print(f"  {scene.source}")
    print("  joints stand still, rigid and without control: give [motion], [effects.joint_flexibility], [control]")
    return DONE
