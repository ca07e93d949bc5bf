"""`flexlin report`: write report.html and report.json."""

import argparse

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import DONE, FAILED, OTHER_VERDICT, command, loaded, meets, print_paths

PURPOSE = "write report.html and report.json"
TAKES = (*COMPUTED, "require", "effects", "sensitivity", "margins", "loop_margins")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.report.writing import write_report

        margins = {key: (low, high) for key, low, high, _ in options.margins} or None
        extras = options.effects, options.sensitivity, margins, options.begun, options.loop_margins
        analysis, paths = write_report(scene, options.out, command(options), progress, *extras)
    from flexlin.report.terminal import summarize

    summarize(analysis)
    print_paths(paths)
    if analysis.own.verdict == "failed":
        return FAILED
    met = meets(options.require, analysis.own.verdict, analysis.validity(analysis.own).verdict)
    return DONE if met else OTHER_VERDICT
