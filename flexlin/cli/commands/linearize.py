"""`flexlin linearize`: write the coefficients over a period."""

import argparse

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import loaded, print_paths

PURPOSE = "write the coefficients over a period"
TAKES = (*SCENE, *LIMITS, "points")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.answers.clock import Budget, Clock
    from flexlin.files import results
    from flexlin.mechanics import build_manipulator
    from flexlin.report.exports import coefficients_dataset, write_dataset

    clock, asked = Clock(budget=Budget(options.watch)), scene.accuracy
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    plant, closed = clock.stage(
        "linearization", asked, lambda: [linearize(arm, scene.motion, control) for control in (None, scene.control)]
    )
    data = clock.stage("coefficients", asked, lambda: coefficients_dataset(scene, plant, closed, options.points))
    with results(options.out, "coefficients") as made:
        paths = write_dataset(data, made, "coefficients")
    return print_paths(paths)
