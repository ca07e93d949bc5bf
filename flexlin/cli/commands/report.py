"""`flexlin report`: write report.html and report.json."""

import argparse

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import DONE, NO_ANSWER, OTHER_VERDICT, command, loaded, meets, print_paths
from flexlin.cli.supervised import send_written
from flexlin.errors import FlexlinError

PURPOSE = "write report.html and report.json"
TAKES = (*COMPUTED, "require", "effects", "sensitivity", "margins", "loop_margins")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.report.writing import write_report

        margins = {key: (low, high) for key, low, high, _ in options.margins} or None
        extras = options.effects, options.sensitivity, margins, options.watch, options.loop_margins, send_written
        analysis, paths = write_report(scene, options.out, command(options), progress, *extras)
    if isinstance(analysis, FlexlinError):
        print_paths(paths)
        raise analysis
    from flexlin.report.terminal import summarize

    summarize(analysis)
    print_paths(paths)
    met = meets(options.require, analysis.own.verdict, analysis.validity(analysis.own).verdict)
    if not met:
        return OTHER_VERDICT
    return NO_ANSWER if analysis.own.verdict == "failed" else DONE
