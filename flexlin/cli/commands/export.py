"""`flexlin export`: write system and designs for other tools: npz, MATLAB, netCDF, C."""

import argparse

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import DONE, NO_ANSWER, loaded, print_paths

PURPOSE = "write system and designs for other tools: npz, MATLAB, netCDF, C"
TAKES = (*COMPUTED, "points")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.analysis import plant_and_designs
        from flexlin.answers.clock import Budget, Clock
        from flexlin.report.exports import check_gains, design_folders, export_all
        from flexlin.report.terminal import accuracy_lines

        design_folders([table.name for table in scene.designs])  # clashing names are refused before any work
        check_gains(scene, options.points)
        clock = Clock(progress, planned=4 + 3 * len(scene.designs), budget=Budget(options.watch))
        plant, loops = plant_and_designs(scene, clock)
        paths = clock.stage(
            "files", scene.accuracy, lambda: export_all(plant, loops, options.out, options.points, scene), last=True
        )
    for line in accuracy_lines(tuple(clock.steps)):
        print(line)
    for loop in loops:
        if loop.design is None:
            print(f"{loop.name}: {loop.problem}")
    print_paths(paths)
    return NO_ANSWER if any(loop.design is None for loop in loops) else DONE
