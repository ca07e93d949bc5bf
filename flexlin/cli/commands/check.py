"""`flexlin check`: read a scene and derive its equations."""

import argparse

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import DONE, loaded

PURPOSE = "read a scene and derive its equations"
TAKES = (*SCENE, *LIMITS)


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.answers.budget import Budget
    from flexlin.answers.clock import Clock
    from flexlin.mechanics import build_manipulator
    from flexlin.report.record import effects

    clock, asked = Clock(budget=Budget(options.begun)), scene.accuracy
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    plant = clock.stage("linearization", asked, lambda: linearize(arm, scene.motion, scene.control))
    print(f"{scene.title}: usable")
    print(f"  coordinates  {', '.join(plant.names)}")
    print(f"  torques on   {', '.join(plant.inputs) or 'no joint'}")
    print(f"  effects on   {', '.join(effects(scene)['on']) or 'none'}")
    print(f"  period       {plant.period:.6g} s")
    return DONE
