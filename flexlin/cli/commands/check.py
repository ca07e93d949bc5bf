"""`flexlin check`: read a scene and derive its equations."""

import argparse

from flexlin.cli.options import SCENE
from flexlin.cli.shared import DONE, loaded

PURPOSE = "read a scene and derive its equations"
TAKES = SCENE


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.mechanics import build_manipulator
    from flexlin.report.record import effects

    plant = linearize(build_manipulator(scene), scene.motion, scene.control)
    print(f"{scene.title}: usable")
    print(f"  coordinates  {', '.join(plant.names)}")
    print(f"  torques on   {', '.join(plant.inputs) or 'no joint'}")
    print(f"  effects on   {', '.join(effects(scene)['on']) or 'none'}")
    print(f"  period       {plant.period:.6g} s")
    return DONE
