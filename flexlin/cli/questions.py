"""Commands that ask something of a whole scene: report, chart, respond, effects, cost."""

import argparse
import math
import sys
from functools import partial
from pathlib import Path
from typing import Literal

from flexlin.cli.shared import COMPUTED, LIMITS, SCENE, Work, command, meets, print_paths
from flexlin.cli.supervised import DONE, NO_ANSWER, OTHER_VERDICT, send_written
from flexlin.errors import ArgumentError, FlexlinError, NumericalError, TooLarge

KINDS: tuple[Literal["step", "initial", "push", "noise"], ...] = ("step", "initial", "push", "noise")
"""Of disturbances."""


@command(
    "report",
    "write report.html and report.json",
    *(*COMPUTED, "require", "effects", "sensitivity", "margins", "loop_margins"),
)
def report(options: argparse.Namespace) -> int:
    work = Work(options)
    with work.clock():
        from flexlin.report.writing import write_report

        margins = {key: (low, high) for key, low, high, _ in options.margins} or None
        extras = options.effects, options.sensitivity, margins, options.watch, options.loop_margins, send_written
        analysis, paths = write_report(work.scene, options.out, work.quoted, work.progress, *extras)
    if isinstance(analysis, FlexlinError):
        print_paths(paths)
        raise analysis
    from flexlin.report.terminal import summarize

    summarize(analysis)
    print_paths(paths)
    if not meets(options.require, analysis.own.verdict, analysis.validity(analysis.own).verdict):
        return OTHER_VERDICT
    return NO_ANSWER if analysis.own.verdict == "failed" else DONE


@command("chart", "stability over one or two parameters", *COMPUTED, "over", "loop", "workers", "scheduler", "store")
def chart(options: argparse.Namespace) -> int:
    work = Work(options)
    scene, spans = work.scene, options.over
    if len(spans) > 2 or len({key for key, *_ in spans}) < len(spans):
        got = ", ".join(key for key, *_ in spans)
        raise ArgumentError("a chart has one or two axes", got=f"--over {got}", expected="one or two different keys")
    with work.clock(3) as clock:
        import numpy as np

        from flexlin.answers.clock import DRAWING
        from flexlin.answers.sweep import check_values
        from flexlin.report.charts import (
            Chart,
            chart_dataset,
            compute_chart,
            draw_charts,
            find_boundary,
            say_bending,
            say_without_picture,
        )
        from flexlin.report.exports import storable
        from flexlin.report.figures import Picture

        counts = [number or (60 if len(spans) > 1 else 200) for *_, number in spans]

        def values() -> dict[str, np.ndarray]:
            check_values(math.prod(counts))
            return {key: np.linspace(low, high, n) for (key, low, high, _), n in zip(spans, counts, strict=True)}

        how = {name: getattr(options, name) for name in ("loop", "workers", "scheduler", "store")}
        data, problem = compute_chart(scene, values, clock, work.progress, **how)
        ranges = {key: (low, high) for key, low, high, _ in spans}
        data.attrs |= {"incomplete": problem} if problem else {}
        found = ([], []) if problem else find_boundary(scene, ranges, data, clock, options.loop)
        data.attrs["bending"] = "" if problem else say_bending(scene, ranges, found[0], clock)
        made = Chart(scene, data, *found)
        numbers, without = storable(chart_dataset(made)), partial(say_without_picture, made)

        def write(pictures: list[Picture]) -> list[Path]:
            return work.write_files("chart", {"chart.html": work.page(pictures)}, numbers)

        send_written(write(without("the program ended before")))
        try:
            draw = partial(draw_charts, made)
            pictures = clock.stage("figures", scene.accuracy, draw, share=DRAWING, last=True)
        except (NumericalError, TooLarge) as error:  # the numbers stand without a picture
            pictures, problem = without(error), problem or str(error)
        paths = write(pictures)
    print(pictures[0].caption)
    if "repaired" in data.attrs:
        print(f"{options.store}: {data.attrs['repaired']} damaged blocks were computed again")
    work.say_accuracy()
    done = print_paths(paths)
    if problem:
        print(f"flexlin: {problem}", file=sys.stderr)
    return NO_ANSWER if problem else done


@command(
    "respond",
    "find what a disturbance does at the worst moment of the motion",
    *(*COMPUTED, "step", "initial", "push", "noise", "of", "lasting"),
)
def respond(options: argparse.Namespace) -> int:
    asked = [(kind, getattr(options, kind)) for kind in KINDS if getattr(options, kind) is not None]
    if len(asked) != 1:
        kinds = "--step, --initial, --push or --noise"
        raise ArgumentError("one disturbance is answered at a time", got=f"{len(asked)}", expected=kinds)
    work = Work(options)
    with work.clock() as clock:
        from flexlin.answers.disturbed import answer_in_scene
        from flexlin.report.figures.answers import answer_lines, answer_record, draw
        from flexlin.report.wording import units_of_scene

        kind, words = asked[0]
        answer = answer_in_scene(work.scene, kind, words, options.of, options.lasting, clock)
    with units_of_scene(work.scene):
        lines, drawn = answer_lines(answer), draw(answer)
    for line in lines:
        print(line)
    work.say_accuracy()
    return work.write("respond", [drawn], answer_record(answer))


@command("effects", "find which effects and modes the scene needs", *COMPUTED, "tolerance")
def effects(options: argparse.Namespace) -> int:
    work = Work(options)
    with work.clock() as clock:
        from flexlin.answers.audit import audit
        from flexlin.report.audit import audit_lines, minimal_text
        from flexlin.report.numbers import audit_block, to_json

        compare = partial(audit, work.scene, options.tolerance, work.progress, work.scene.accuracy.tol)
        result = clock.stage("audit of the effects", work.scene.accuracy, compare)
    print("\n".join(audit_lines(result)))
    texts = {"effects.json": to_json({"schema": 1, "title": work.scene.title, **audit_block(result)})}
    if result.minimal is not None:
        texts["minimal.toml"] = minimal_text(result, result.minimal, work.quoted)
    done = print_paths(work.write_files("effects", texts))
    return NO_ANSWER if result.problem else done


@command("cost", "measure what accuracy costs in time, beside other programs (a minute)", *SCENE, *LIMITS)
def measure_cost(options: argparse.Namespace) -> int:
    work = Work(options)
    with work.clock() as clock:
        from flexlin.answers.accuracy import cost
        from flexlin.report.figures.cost import cost_table, draw_cost, summarise_cost

        seconds = clock.budget.plan("accuracy against time", work.scene.accuracy)
        measure = partial(cost, work.scene, seconds=seconds)
        result = clock.stage("accuracy against time", work.scene.accuracy, measure)
    print(cost_table(result))
    done = work.write("cost", [draw_cost(result)], result.record(), summarise_cost(result))
    return done if result.rows else NO_ANSWER
