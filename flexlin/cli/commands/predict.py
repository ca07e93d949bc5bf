"""`flexlin predict`: hold the scene's equations against a measured log."""

import argparse
from functools import partial

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import command, loaded, print_paths

PURPOSE = "predict a measured log, without fitting anything to it"
TAKES = (*SCENE, *LIMITS, "log", "window")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.clock import Budget, Clock
        from flexlin.files import results
        from flexlin.identification import predict, read_log
        from flexlin.report.figures.comparison import draw_prediction
        from flexlin.report.numbers import to_json
        from flexlin.report.page import picture_page
        from flexlin.report.terminal import say

        clock = Clock(progress, budget=Budget(options.watch))
        log = clock.stage("read the log", scene.accuracy, partial(read_log, options.log, scene))
        work = partial(predict, scene, log, options.window)
        found = clock.stage("predict the log", scene.accuracy, work)
    for line in found.summary().splitlines():
        say(line)
    record = {
        "schema": 1,
        "title": scene.title,
        "log": log.source,
        "window": options.window,
        "fit": found.fit,
        "starts": found.starts.tolist(),
        "status": found.status,
    }
    with results(options.out, "predict") as made:
        page = picture_page(scene.title, draw_prediction(found), command(options))
        (made / "predict.html").write_text(page, encoding="utf-8")
        (made / "predict.json").write_text(to_json(record), encoding="utf-8")
    return print_paths(made.placed("predict.html", "predict.json"))
