"""From a scene to report.json and report.html."""

from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from flexlin.answers.budget import Budget
from flexlin.answers.clock import Clock, Progress
from flexlin.files import results
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from flexlin.answers.analysis import Analysis
    from flexlin.answers.margins import Margin


USUAL = 4.0
"""Seconds of 60 that a margin may take that nobody asked for."""
STAGES = 15
"""Of a report without designs, about."""


def write_report(
    scene: Scene,
    folder: Path,
    command: str = "",
    progress: Progress | None = None,
    with_audit: bool = False,
    with_sensitivity: bool = False,
    margins: "Mapping[str, tuple[float, float]] | None" = None,
    begun: float | None = None,
    with_loop_margins: bool = False,
) -> "tuple[Analysis, list[Path]]":
    """Analyse a scene and write report.html and report.json into a folder, as one set.

    Parameters: command: the command line, which the page shows; progress: called with the name of each step as it begins;
    with_audit, with_sensitivity: also find which effects and which numbers matter (some seconds each);
    margins: numbers whose critical values are looked for, with their ranges; by default speed and payload, by a coarse scan;
    with_loop_margins: also find which gain, phase and delay each loop endures (some seconds a loop);
    begun: the time by `perf_counter` from which the limit of time counts, by default now.
    Returns: the analysis and the paths of the files.
    Raises: what `analyse` raises; OutputError when the folder cannot be written.
    """
    budget = Budget() if begun is None else Budget(begun)
    clock = Clock(progress, planned=STAGES + 3 * len(scene.designs) + with_audit + with_sensitivity, budget=budget)
    with clock.step("load the numerical libraries"):
        from flexlin.answers.analysis import analyse
        from flexlin.report.record import record, to_json
    if scene.uncertainty:
        with clock.step("equations with the uncertain numbers free"):
            from flexlin.answers.nearest.box import make_box
            from flexlin.answers.nearest.instability import search_box

            box = make_box(scene)
    from flexlin.answers.margins import choose_margins

    analysis, asked = analyse(scene, clock, tuple(choose_margins(scene)) if margins is None else ()), scene.accuracy
    analysis = replace(analysis, margins=find_margins(scene, margins, analysis, clock))
    if with_audit:
        from flexlin.answers.audit.comparison import audit

        work = partial(audit, scene, progress=progress, tol=asked.tol)
        found = clock.attempt(analysis.problems, "effects audit", "audit of the effects", asked, work)
        analysis = replace(analysis, audit=found)
    if with_sensitivity:
        from flexlin.answers.sensitivity import sensitivity

        rates = partial(sensitivity, scene, tol=asked.tol)
        moved = clock.attempt(analysis.problems, "sensitivity", "sensitivities", asked, rates)
        analysis = replace(analysis, sensitivity=moved)
    if with_loop_margins:
        from flexlin.answers.endurance import find_loop_margins

        analysis = replace(analysis, endured=find_loop_margins(analysis, clock))
    if scene.uncertainty:
        key, name = "uncertainty", "smallest change that makes the loop unstable"
        place = clock.attempt(analysis.problems, key, name, asked, partial(search_box, box))
        analysis = replace(analysis, nearest=place)
    with clock.step("load the drawing library"):
        from flexlin.report.figures import draw_pictures
        from flexlin.report.page import render_page
    drawn = clock.stage("figures", asked, partial(draw_pictures, analysis), last=True)
    analysis = replace(analysis, steps=tuple(clock.steps))
    data = record(analysis)
    with results(folder, "report") as made:
        (made / "report.html").write_text(render_page(analysis, data, drawn, command), encoding="utf-8")
        (made / "report.json").write_text(to_json(data), encoding="utf-8")
    return analysis, made.placed("report.html", "report.json")


def find_margins(
    scene: Scene, chosen: "Mapping[str, tuple[float, float]] | None", analysis: "Analysis", clock: Clock
) -> "tuple[Margin, ...]":
    """The critical values of some numbers; none of a number that meets a limit, or, where nobody chose it, cannot be free."""
    from flexlin.answers.margins import Shared, choose_margins, find_margin, find_usual_margin

    ranges, at_most = (choose_margins(scene), USUAL) if chosen is None else (dict(chosen), inf)
    usual = partial(find_usual_margin, own=analysis.own.floquet, shared=Shared(scene, ranges, analysis.closed))
    find: Callable[..., Margin | None] = find_margin if chosen is not None else usual
    found: list[Margin | None] = []
    for path, limits in ranges.items():
        key, step, work = f"margin {path}", f"critical values of {path}", partial(find, scene, path, limits)
        found.append(clock.attempt(analysis.problems, key, step, scene.accuracy, work, at_most=at_most))
    return tuple(margin for margin in found if margin is not None)
