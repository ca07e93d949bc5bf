"""Commands about measured logs: predict, identify."""

import argparse
from functools import partial

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import LONG, NO_ANSWER, Work, command


@command("predict", "predict a measured log, without fitting anything to it", *SCENE, *LIMITS, "log", "window")
def predict_log(options: argparse.Namespace) -> int:
    work = Work(options)
    with work.clock() as clock:
        from flexlin.identification import predict, read_log
        from flexlin.report.figures.comparison import draw_prediction
        from flexlin.report.numbers import record_fields

        scene = work.scene
        log = clock.stage("read the log", scene.accuracy, partial(read_log, options.log, scene))
        fit = partial(predict, scene, log, options.window)
        found = clock.stage("predict the log", scene.accuracy, fit)
    print(found.summary())
    record = {"log": log.source, "window": options.window, **record_fields(found, "fit starts status")}
    return work.write("predict", [draw_prediction(found)], record)


@command(
    "identify",
    "find numbers of the scene, with their errors, from a measured log",
    *(*SCENE, *LIMITS, "log", "free", "window", "hold_back"),
)
def identify_numbers(options: argparse.Namespace) -> int:
    work = Work(options, LONG)
    with work.clock() as clock:
        from flexlin.identification import identify, read_log
        from flexlin.report.figures.comparison import draw_errors, draw_prediction, say_numbers
        from flexlin.report.numbers import record_fields
        from flexlin.scene.loading import raw_tables
        from flexlin.scene.toml import write_toml

        scene = work.scene
        log = clock.stage("read the log", scene.accuracy, partial(read_log, options.log, scene))
        seconds = clock.budget.allow("fit the log", scene.accuracy).seconds
        fit = partial(identify, scene, log, options.free, options.window, options.hold_back, seconds=seconds)
        found = clock.stage("fit the log", scene.accuracy, fit)
    print(found.summary())
    fields = "values errors unknown correlations fit noise settled status"
    record = {"log": log.source, **record_fields(found, fields)}
    pictures = [draw_prediction(found.prediction), draw_errors(found.prediction)]
    fitted = {"fitted.toml": write_toml(raw_tables(found.scene))}
    done = work.write("identify", pictures, record, say_numbers(scene, found), fitted)
    return done if found.settled else NO_ANSWER
