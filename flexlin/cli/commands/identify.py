"""`flexlin identify`: find numbers of the scene from a measured log."""

import argparse
from functools import partial

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import NO_ANSWER, command, loaded, print_paths

PURPOSE = "find numbers of the scene, with their errors, from a measured log"
TAKES = (*SCENE, *LIMITS, "log", "free", "window", "hold_back")
USUAL = 600.0
"""Limit in s where nobody states one."""


def run(options: argparse.Namespace) -> int:
    scene = loaded(options, USUAL)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.clock import Budget, Clock
        from flexlin.files import results
        from flexlin.identification import identify, read_log
        from flexlin.report.figures.comparison import draw_errors, draw_prediction, say_numbers
        from flexlin.report.numbers import to_json
        from flexlin.report.page import picture_page
        from flexlin.report.terminal import say
        from flexlin.scene.revised import raw_tables
        from flexlin.scene.toml import write_toml

        clock, name = Clock(progress, budget=Budget(options.watch)), "fit the log"
        log = clock.stage("read the log", scene.accuracy, partial(read_log, options.log, scene))
        seconds = clock.budget.allow(name, scene.accuracy).seconds
        work = partial(identify, scene, log, options.free, options.window, options.hold_back, seconds=seconds)
        found = clock.stage(name, scene.accuracy, work)
    for line in found.summary().splitlines():
        say(line)
    record = {
        "schema": 1,
        "title": scene.title,
        "log": log.source,
        "values": found.values,
        "errors": found.errors,
        "unknown": found.unknown,
        "correlations": found.correlations,
        "fit": found.fit,
        "noise": found.noise,
        "settled": found.settled,
        "status": found.status,
    }
    with results(options.out, "identify") as made:
        pictures = draw_prediction(found.prediction), [draw_errors(found.prediction)]
        page = picture_page(scene.title, pictures[0], command(options), pictures[1], say_numbers(scene, found))
        (made / "identify.html").write_text(page, encoding="utf-8")
        (made / "identify.json").write_text(to_json(record), encoding="utf-8")
        (made / "fitted.toml").write_text(write_toml(raw_tables(found.scene)), encoding="utf-8")
    done = print_paths(made.placed("identify.html", "identify.json", "fitted.toml"))
    return done if found.settled else NO_ANSWER
