"""`flexlin effects`: find which effects and modes the scene needs."""

import argparse
from functools import partial

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import NO_ANSWER, command, loaded, print_paths

PURPOSE = "find which effects and modes the scene needs"
TAKES = (*COMPUTED, "tolerance")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.audit.comparison import audit
        from flexlin.answers.clock import Budget, Clock
        from flexlin.files import results
        from flexlin.report.minimal import minimal_text
        from flexlin.report.numbers import audit_block, to_json
        from flexlin.report.terminal import audit_lines, say

        work = partial(audit, scene, options.tolerance, progress, scene.accuracy.tol)
        clock = Clock(progress, budget=Budget(options.watch))
        result = clock.stage("audit of the effects", scene.accuracy, work)
    for line in audit_lines(result):
        say(line)
    texts = {"effects.json": to_json({"schema": 1, "title": scene.title, **audit_block(result)})}
    if result.minimal is not None:
        texts["minimal.toml"] = minimal_text(result, result.minimal, command(options))
    with results(options.out, "effects") as made:
        for name, text in texts.items():
            (made / name).write_text(text, encoding="utf-8")
    done = print_paths(made.placed(*texts))
    return NO_ANSWER if result.problem else done
