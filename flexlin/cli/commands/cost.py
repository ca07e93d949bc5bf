"""`flexlin cost`: measure what accuracy costs in time, beside other programs (a minute)."""

import argparse
import os
import sys

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import NO_ANSWER, command, loaded, print_paths

PURPOSE = "measure what accuracy costs in time, beside other programs (a minute)"
TAKES = (*SCENE, *LIMITS)
USED = 0.9
"""Share of the time that the measuring plans with: one call of a library may take longer than those before it."""


def run(options: argparse.Namespace) -> int:
    if "numpy" not in sys.modules:  # afterwards it is too late: the times are those of one thread
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            os.environ.setdefault(name, "1")
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.accuracy import cost
        from flexlin.answers.clock import Budget, Clock
        from flexlin.files import results
        from flexlin.report.costing import cost_table, summarise_cost
        from flexlin.report.figures.cost import draw_cost
        from flexlin.report.numbers import to_json
        from flexlin.report.page import picture_page

        clock, name = Clock(progress, budget=Budget(options.watch)), "accuracy against time"
        seconds = USED * clock.budget.allow(name, scene.accuracy).seconds
        result = clock.stage(name, scene.accuracy, lambda: cost(scene, seconds=seconds))
    print(cost_table(result))
    with results(options.out, "cost") as made:
        (made / "cost.html").write_text(
            picture_page(scene.title, draw_cost(result), command(options), said=summarise_cost(result)),
            encoding="utf-8",
        )
        (made / "cost.json").write_text(to_json(result.record()), encoding="utf-8")
    done = print_paths(made.placed("cost.html", "cost.json"))
    return done if result.rows else NO_ANSWER
