"""From a scene to report.json and report.html."""

from contextlib import nullcontext, suppress
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import flexlin
from flexlin import analyses
from flexlin.analyses.clock import DRAWING_SHARE, STAGE_SHARE, Clock, Progress, Step
from flexlin.errors import FlexlinError, InputError, NumericalError, TooLarge
from flexlin.files import results
from flexlin.resources import LIMIT_SECONDS, Stopwatch
from flexlin.scene.loading import check_axes
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from flexlin.analyses.analysis import Analysis
    from flexlin.analyses.boundary import Margin
    from flexlin.report.figures import Picture


def write_report(
    scene: Scene,
    folder: Path,
    command: str = "",
    progress: Progress | None = None,
    extras: "Collection[str]" = (),
    margins: "Mapping[str, tuple[float, float]] | None" = None,
    watch: Stopwatch | None = None,
    written: "Callable[[list[Path]], None]" = lambda _: None,
) -> "tuple[Analysis | FlexlinError, list[Path]]":
    """Analyse a scene and write report.html and report.json into a folder, as one set: first the numbers, then with the figures.

    Parameters: command: the command line, which the page shows; progress: called with the name of each step as it begins;
    extras: what is also found, some seconds each: which "effects" and which numbers matter ("sensitivity"), and which gain, phase and
    delay each loop endures ("loop_margins", a loop);
    margins: numbers whose critical values are looked for, with their ranges; by default speed and payload, about a second for both;
    watch: from when the limits of time count, by default now;
    written: called with the paths once the numbers stand: whatever becomes of the figures, they stay.
    Returns: the analysis, or why there are no linear equations, which the files say then; and their paths.
    Raises: InputError as `analyse`; OutputError when the folder cannot be written.
    """
    planned = 15 + 3 * len(scene.designs) + len(extras)
    clock = Clock(scene.accuracy, progress, planned, watch or Stopwatch())
    with clock.step("load the numerical libraries"):
        from flexlin.report.numbers import record, step_block, to_json
    if scene.uncertainty:
        with clock.step("equations with the uncertain numbers free"):
            box = analyses.make_box(scene)
    check_axes(scene, {path: np.array(limits) for path, limits in (margins or {}).items()}, grid=False)
    asked = scene.accuracy
    try:
        varied = analyses.choose_margins(scene) if margins is None else margins
        a: Analysis = analyses.analyse(scene, clock, tuple(varied))
    except (NumericalError, TooLarge) as error:
        return error, write_why(scene, folder, command, clock, error)
    a.margins = find_margins(a, margins)
    if "effects" in extras:
        compare = partial(flexlin.audit, scene, progress=progress, tol=asked.tol)
        a.audit = a.attempt("effects audit", "audit of the effects", compare, wanted=True)
    if "sensitivity" in extras:
        find = partial(flexlin.sensitivity, scene, tol=asked.tol)
        a.sensitivity = a.attempt("sensitivity", "sensitivities", find, wanted=True)
    if "loop_margins" in extras:
        analyses.find_loop_margins(a)
    if scene.uncertainty:
        name = "smallest change that makes the loop unstable"
        a.nearest = a.attempt("uncertainty", name, partial(analyses.search_box, box), wanted=True)
    with clock.step("load the drawing library"):
        from flexlin.report.page import render_page
    data = record(a)

    def write(pictures: "list[Picture]", *ends: Step) -> "tuple[Analysis, list[Path]]":
        a.steps = (*clock.steps, *ends)
        data["steps"] = [step_block(step) for step in a.steps]
        return a, write_both(folder, render_page(a, data, pictures, command), to_json(data))

    ended = Step("figures", 0.0, problem="figures: the program was ended before they were drawn")
    written(write([], ended)[1])
    return write(draw_in_time(a, clock))


def draw_in_time(analysis: "Analysis", clock: Clock) -> "list[Picture]":
    """The figures, as far as they meet no limit: the numbers stand without them, and the step says what was left out."""
    from flexlin.report.page import draw_pictures

    drawn: list[Picture] = []
    draw = partial(drawn.extend, draw_pictures(analysis))  # what was drawn before a limit stays
    with suppress(NumericalError, TooLarge):
        clock.stage("figures", draw, share=DRAWING_SHARE, last=True)
    return drawn


def write_why(scene: Scene, folder: Path, command: str, clock: Clock, error: FlexlinError) -> "list[Path]":
    """The report of a scene that has no linear equations, or none within its limits: what was asked, and how far it came."""
    from flexlin.report.figures import Picture
    from flexlin.report.numbers import record_scene, to_json
    from flexlin.report.page import picture_page

    page = picture_page(scene.title, Picture("why", "There are no linear equations", str(error), ""), command)
    return write_both(folder, page, to_json({**record_scene(scene, clock.steps), "problem": str(error)}))


def write_both(folder: Path, page: str, data: str) -> "list[Path]":
    """Write report.html and report.json as one set; returns where they are."""
    with results(folder, "report") as made:
        (made / "report.html").write_text(page, encoding="utf-8")
        (made / "report.json").write_text(data, encoding="utf-8")
    return made.placed("report.html", "report.json")


def find_margins(a: "Analysis", chosen: "Mapping[str, tuple[float, float]] | None") -> "tuple[Margin, ...]":
    """The critical values of some numbers, or what is known of them at the end of their time; none of one that nobody chose and that cannot
    be free. The last one comes first: the search for a payload mostly ends before its time, and leaves the rest to speed."""
    scene, asked, watch = a.scene, a.asked, Stopwatch()
    ranges = analyses.choose_margins(scene) if chosen is None else dict(chosen)
    unasked = analyses.UNASKED_SECONDS * max(1.0, asked.seconds / LIMIT_SECONDS)
    found: list[Margin | None] = []
    for left, (path, limits) in zip(range(len(ranges), 0, -1), reversed(ranges.items()), strict=True):

        def work(path: str = path, limits: tuple[float, float] = limits, left: int = left) -> "Margin | None":
            seconds = unasked - watch.seconds if chosen is None else a.clock.plan(STAGE_SHARE)
            with suppress(InputError) if chosen is None else nullcontext():
                return analyses.find_margin(scene, path, limits, seconds / left, a.closed)
            return None

        wanted, name = chosen is not None, f"critical values of {path}"
        margin = a.attempt(f"margin {path}", name, work, wanted=wanted, at_most=inf if wanted else 4.0)
        a.unanswered += [name] if margin and margin.gap and wanted else []
        found.append(margin)
    return tuple(margin for margin in reversed(found) if margin is not None)
