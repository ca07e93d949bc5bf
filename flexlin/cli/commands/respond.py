"""`flexlin respond`: find what a disturbance does at the worst moment of the motion."""

import argparse
from typing import Literal

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import command, loaded, print_paths
from flexlin.errors import ArgumentError

PURPOSE = "find what a disturbance does at the worst moment of the motion"
TAKES = (*COMPUTED, "step", "initial", "push", "noise", "of", "lasting")
KINDS: tuple[Literal["step", "initial", "push", "noise"], ...] = ("step", "initial", "push", "noise")


def run(options: argparse.Namespace) -> int:
    asked = [(kind, getattr(options, kind)) for kind in KINDS if getattr(options, kind) is not None]
    if len(asked) != 1:
        raise ArgumentError(
            "one disturbance is answered at a time",
            got=f"{len(asked)}",
            expected="--step, --initial, --push or --noise",
        )
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.clock import Budget, Clock
        from flexlin.answers.disturbed.respond import answer_in_scene
        from flexlin.files import results
        from flexlin.report.answer import answer_lines, answer_record, draw
        from flexlin.report.numbers import to_json
        from flexlin.report.page import picture_page
        from flexlin.report.terminal import accuracy_lines, say
        from flexlin.report.wording import units_of_scene

        clock = Clock(progress, budget=Budget(options.watch))
        kind, words = asked[0]
        answer = answer_in_scene(scene, kind, words, options.of, options.lasting, clock)
    with units_of_scene(scene):
        lines, drawn = answer_lines(answer), draw(answer)
    for line in (*lines, *accuracy_lines(tuple(clock.steps))):
        say(line)
    with results(options.out, "respond") as made:
        page = picture_page(scene.title, drawn, command(options))
        (made / "respond.html").write_text(page, encoding="utf-8")
        (made / "respond.json").write_text(to_json(answer_record(scene.title, answer)), encoding="utf-8")
    return print_paths(made.placed("respond.html", "respond.json"))
