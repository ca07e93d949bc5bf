"""From a scene to report.json and report.html."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flexlin.answers.clock import Clock, Progress
from flexlin.files import results
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    from flexlin.answers.analysis import Analysis


STAGES = 13
"""Of a report without designs, about."""


def write_report(
    scene: Scene,
    folder: Path,
    command: str = "",
    progress: Progress | None = None,
    with_audit: bool = False,
    with_sensitivity: bool = False,
) -> "tuple[Analysis, list[Path]]":
    """Analyse a scene and write report.html and report.json into a folder, as one set.

    Parameters: command: the command line, which the page shows; progress: called with the name of each step as it begins;
    with_audit, with_sensitivity: also find which effects and which numbers matter (some seconds each).
    Returns: the analysis and the paths of the files.
    Raises: what `analyse` raises; OutputError when the folder cannot be written.
    """
    clock = Clock(progress, planned=STAGES + 3 * len(scene.designs) + with_audit + with_sensitivity)
    with clock.step("load the numerical libraries"):
        from flexlin.answers.analysis import analyse
        from flexlin.report.record import record, to_json
    analysis, asked = analyse(scene, clock), scene.accuracy
    if with_audit:
        from flexlin.answers.audit import audit

        work = partial(audit, scene, progress=progress, tol=asked.tol)
        found = clock.attempt(analysis.problems, "effects audit", "audit of the effects", asked, work)
        analysis = replace(analysis, audit=found)
    if with_sensitivity:
        from flexlin.answers.sensitivity import sensitivity

        rates = partial(sensitivity, scene, tol=asked.tol)
        moved = clock.attempt(analysis.problems, "sensitivity", "sensitivities", asked, rates)
        analysis = replace(analysis, sensitivity=moved)
    with clock.step("load the drawing library"):
        from flexlin.report.figures import draw_pictures
        from flexlin.report.page import render_page
    drawn = clock.stage("figures", asked, partial(draw_pictures, analysis))
    analysis = replace(analysis, steps=tuple(clock.steps))
    data = record(analysis)
    with results(folder, "report") as made:
        (made / "report.html").write_text(render_page(analysis, data, drawn, command), encoding="utf-8")
        (made / "report.json").write_text(to_json(data), encoding="utf-8")
    return analysis, made.placed("report.html", "report.json")
