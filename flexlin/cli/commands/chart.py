"""`flexlin chart`: stability over one or two parameters."""

import argparse
import math
import sys
from functools import partial
from pathlib import Path

from flexlin.cli.options import COMPUTED
from flexlin.cli.shared import NO_ANSWER, command, loaded, print_paths
from flexlin.cli.supervised import send_written
from flexlin.errors import ArgumentError, NumericalError, TooLarge

PURPOSE = "stability over one or two parameters"
TAKES = (*COMPUTED, "over", "loop", "workers", "scheduler", "store")


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    spans = options.over
    if len(spans) > 2 or len({key for key, *_ in spans}) < len(spans):
        got = ", ".join(key for key, *_ in spans)
        raise ArgumentError("a chart has one or two axes", got=f"--over {got}", expected="one or two different keys")
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        import numpy as np

        from flexlin.answers.clock import DRAWING, Budget, Clock
        from flexlin.answers.sweep import check_values
        from flexlin.files import results
        from flexlin.report.charts import chart_dataset, compute_chart, draw_charts, find_boundary
        from flexlin.report.exports import storable, write_dataset
        from flexlin.report.figures.style import Picture
        from flexlin.report.page import picture_page
        from flexlin.report.terminal import accuracy_lines

        counts = [number or (60 if len(spans) > 1 else 200) for *_, number in spans]

        def values() -> dict[str, np.ndarray]:
            check_values(math.prod(counts))
            return {key: np.linspace(low, high, n) for (key, low, high, _), n in zip(spans, counts, strict=True)}

        clock = Clock(progress, planned=3, budget=Budget(options.watch))
        how = {name: getattr(options, name) for name in ("loop", "workers", "scheduler", "store")}
        data, problem = compute_chart(scene, values, clock, progress, **how)
        ranges = {key: (low, high) for key, low, high, _ in spans}
        data.attrs |= {"search": problem} if problem else {}
        found = ([], []) if problem else find_boundary(scene, ranges, data, clock, options.loop)
        numbers = storable(chart_dataset(scene, data, *found))

        def without(why: object) -> list[Picture]:
            return [Picture("chart", "Stability chart", f"The picture was not drawn: {why}.", "")]

        def write(pictures: list[Picture]) -> list[Path]:
            page = picture_page(scene.title, pictures[0], command(options), pictures[1:])
            with results(options.out, "chart") as made:
                (made / "chart.html").write_text(page, encoding="utf-8")
                return made.placed("chart.html") + write_dataset(numbers, made, "chart")

        send_written(write(without("the program was ended before")))
        try:
            work = partial(draw_charts, scene, data, *found)
            pictures = clock.stage("figures", scene.accuracy, work, share=DRAWING, last=True)
        except (NumericalError, TooLarge) as error:  # the numbers stand without a picture
            pictures, problem = without(error), problem or str(error)
        paths = write(pictures)
    print(pictures[0].caption)
    if "repaired" in data.attrs:
        print(f"{options.store}: {data.attrs['repaired']} damaged blocks were computed again")
    for line in accuracy_lines(tuple(clock.steps)):
        print(line)
    done = print_paths(paths)
    if problem:
        print(f"flexlin: {problem}", file=sys.stderr)
    return NO_ANSWER if problem else done
