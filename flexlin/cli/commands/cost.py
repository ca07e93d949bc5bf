"""`flexlin cost`: measure what accuracy costs in time, beside other programs (a minute)."""

import argparse

from flexlin.cli.options import SCENE
from flexlin.cli.shared import command, loaded, print_paths

PURPOSE = "measure what accuracy costs in time, beside other programs (a minute)"
TAKES = SCENE


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        import json

        from flexlin.answers.accuracy import cost
        from flexlin.files import write_text
        from flexlin.report.figures.cost import cost_table, draw_cost
        from flexlin.report.page import picture_page

        progress("accuracy against time, stage by stage")
        result = cost(scene)
    print(cost_table(result))
    page, data = options.out / "cost.html", options.out / "cost.json"
    write_text(page, picture_page(scene.title, draw_cost(result), command(options)))
    write_text(data, json.dumps(result.record(), indent=1))
    return print_paths([page, data])
