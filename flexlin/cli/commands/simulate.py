"""`flexlin simulate`: integrate the nonlinear equations beside the linear ones."""

import argparse
from functools import partial
from pathlib import Path

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import NO_ANSWER, command, loaded, print_paths
from flexlin.cli.supervised import send_written

PURPOSE = "integrate the nonlinear equations beside the linear ones"
TAKES = (*COMPUTED, "periods", "feedforward", "attraction", "animate")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.answers.clock import Budget, Clock
    from flexlin.files import results
    from flexlin.mechanics import build_manipulator
    from flexlin.report.exports import described, write_dataset
    from flexlin.report.progress import Progress
    from flexlin.report.terminal import accuracy_lines, say
    from flexlin.simulation.run import check_duration, simulate

    asked, tol, said, problems = scene.accuracy, scene.accuracy.tol, list[str](), dict[str, str]()
    with Progress() as progress:
        clock = Clock(progress, planned=4 + 2 * options.attraction + options.animate, budget=Budget(options.watch))
        arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
        closed = clock.stage("linearization", asked, lambda: linearize(arm, scene.motion, scene.control))
        clock.stage("size of the result", asked, lambda: check_duration(closed, options.periods))
        forward = None
        if options.feedforward != "scene":
            from flexlin.control.tracking import feedforward

            forward = clock.stage("feedforward", asked, lambda: feedforward(closed, options.feedforward, tol))
        result = clock.stage(
            "nonlinear simulation",
            asked,
            lambda: simulate(closed, options.periods, feedforward=forward, tol=tol),
            lambda found: max(found.error, found.linear_error),
        )
        words = "deviations from the rigid motion as states [y; y'], tips in m"
        data = described(result.dataset(), scene, closed.period, words)

        def write(pages: dict[str, str]) -> list[Path]:
            with results(options.out, "simulation") as made:
                for name, page in pages.items():
                    (made / name).write_text(page, encoding="utf-8")
                return write_dataset(data, made, "simulation") + made.placed(*pages)

        send_written(paths := write({}))
        if options.attraction:
            from flexlin.control.validity import linear_range
            from flexlin.simulation.attraction import region_of_attraction

            both = {
                "range of the linear equations": lambda: linear_range(closed, tol=tol).status,
                "region of attraction": lambda: region_of_attraction(closed, tol=tol).status,
            }
            said = [clock.attempt(problems, name, name, asked, work) or problems[name] for name, work in both.items()]
        if options.animate:
            from flexlin.report.animation import animation_page

            draw = partial(animation_page, scene, closed, result, command(options))
            page = clock.attempt(problems, "animation", "animation", asked, draw)
            if page is None:
                said.append(problems["animation"])
            else:
                paths = write({"animation.html": page})
    for line in (result.status, *filter(None, [result.sticking]), *said, *accuracy_lines(tuple(clock.steps))):
        say(line)
    done = print_paths(paths)
    return NO_ANSWER if problems else done
