"""`flexlin design`: design the scene's controllers, write their gains."""

import argparse

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import DONE, NO_ANSWER, OTHER_VERDICT, loaded, meets, print_paths
from flexlin.errors import ArgumentError

PURPOSE = "design the scene's controllers, write their gains"
TAKES = (*COMPUTED, "require", "points")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress
    from flexlin.report.terminal import accuracy_lines, say, say_loop

    if not scene.designs:
        raise ArgumentError("nothing to design", got="no [[designs]] table", expected="at least one in the scene")
    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.analysis import plant_and_designs
        from flexlin.answers.clock import Budget, Clock
        from flexlin.answers.steady import arm_length
        from flexlin.answers.validity import judge_model
        from flexlin.files import results
        from flexlin.report.exports import check_gains, gains_dataset, write_dataset
        from flexlin.report.wording import reason

        check_gains(scene, options.points)
        clock = Clock(progress, planned=3 + 3 * len(scene.designs), budget=Budget(options.watch))
        plant, loops = plant_and_designs(scene, clock)
    models = [judge_model(arm_length(plant), loop.steady) for loop in loops]
    for loop, model in zip(loops, models, strict=True):
        say_loop(loop, plant.period, model)
        if model.verdict == "invalid":
            say(f"    {reason(model)}")
    for line in accuracy_lines(tuple(clock.steps)):
        say(line)
    made = [loop.design for loop in loops if loop.design is not None]
    if made:
        data = gains_dataset(scene, plant, made, options.points)
        with results(options.out, "gains") as files:
            paths = write_dataset(data, files, "gains")
        print_paths(paths)
    if len(made) < len(loops):
        return NO_ANSWER
    met = all(meets(options.require, loop.verdict, model.verdict) for loop, model in zip(loops, models, strict=True))
    return DONE if met else OTHER_VERDICT
