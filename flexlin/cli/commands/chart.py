"""`flexlin chart`: stability over one or two parameters."""

import argparse
import math
from functools import partial

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import command, loaded, print_paths
from flexlin.errors import ArgumentError

PURPOSE = "stability over one or two parameters"
TAKES = (*COMPUTED, "over")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    spans, several = options.over, len(options.over) > 1
    if len(spans) > 2 or len({key for key, *_ in spans}) < len(spans):
        got = ", ".join(key for key, *_ in spans)
        raise ArgumentError("a chart has one or two axes", got=f"--over {got}", expected="one or two different keys")
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        import numpy as np

        from flexlin.answers.clock import Clock
        from flexlin.answers.sweep import check_values, sweep, worst_error
        from flexlin.files import results
        from flexlin.report.figures.chart import draw_chart
        from flexlin.report.page import picture_page
        from flexlin.report.tables import storable, write_dataset
        from flexlin.report.terminal import accuracy_lines

        clock, counts = Clock(progress, planned=2), [number or (60 if several else 200) for *_, number in spans]
        clock.stage("size of the result", scene.accuracy, lambda: check_values(math.prod(counts)))
        values = {key: np.linspace(low, high, n) for (key, low, high, _), n in zip(spans, counts, strict=True)}
        work = partial(sweep, scene, values, scene.accuracy.tol, grid=several)
        data = clock.stage("exponents of all values", scene.accuracy, work, worst_error)
        picture = draw_chart(data)
    print(picture.caption)
    for line in accuracy_lines(tuple(clock.steps)):
        print(line)
    with results(options.out, "chart") as made:
        (made / "chart.html").write_text(picture_page(scene.title, picture, command(options)), encoding="utf-8")
        paths = made.placed("chart.html") + write_dataset(storable(data), made, "chart")
    return print_paths(paths)
