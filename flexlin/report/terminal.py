"""What the command line prints: short, and in colour only on a terminal."""

import sys
from collections.abc import Sequence

from flexlin.answers.analysis import Analysis
from flexlin.answers.clock import Step
from flexlin.answers.judging import Loop, ModelValidity
from flexlin.errors import counted
from flexlin.report import wording
from flexlin.report.advice import advise, drive_line

UNKNOWN = ModelValidity("unknown")
COLOURS = {"stable": "green", "unstable": "red", "undecided": "yellow", "one-way": "yellow", "failed": "red"}


def say(text: str, verdict: str = "", shade: str = "") -> None:
    """Print a line; a verdict at its beginning is coloured on a terminal."""
    if not verdict or not sys.stdout.isatty():
        print(text)
        return
    from rich.console import Console
    from rich.text import Text

    line = Text(text)
    line.highlight_words([verdict], f"{shade} bold")
    Console(highlight=False, soft_wrap=True).print(line)


def say_loop(loop: Loop, period: float, model: ModelValidity = UNKNOWN) -> None:
    """Print the verdict on a loop, in the colour of doubt where there is one."""
    say(loop_line(loop, period, model), loop.verdict, COLOURS[wording.colour(loop, period, model)])


def summarize(analysis: Analysis) -> None:
    """Print the verdicts and what to do next."""
    with wording.units_of(analysis):
        say(analysis.scene.title)
        for loop in analysis.loops:
            say_loop(loop, analysis.plant.period, analysis.validity(loop))
            if over := drive_line(analysis, loop):
                say(f"    {over}")
        if critical := wording.describe_margins(analysis.scene, analysis.margins, analysis.problems):
            say(f"  {analysis.own.name} {critical}")
        if analysis.nearest:
            nearest = wording.describe_nearest(analysis.scene, analysis.nearest)
            say(f"  {analysis.own.name} with its uncertain numbers: {nearest}")
        said = [f"- {step}" for step in advise(analysis)]
        print("\n".join([*said, *accuracy_lines(analysis.steps, "\n".join(said))]))


def accuracy_lines(steps: Sequence[Step], said: str = "") -> list[str]:
    """What was asked, what was reached, what it took: one line, and one for each stage that missed or has no answer that was not `said`."""
    judged = [step for step in steps if step.asked is not None]
    total, cpu = (wording.format_with_prefix(seconds, "s") for seconds in wording.took(steps))
    spent = f"took {total} ({cpu} of a processor)"
    notes = [f"  {step.name}: {note}" for step in steps for note in step.notes]
    if not judged:
        return [spent, *notes]
    asked = dict.fromkeys(step.asked or 0.0 for step in judged)
    met = [describe_reached(tol, [step for step in judged if step.asked == tol]) for tol in asked]
    lines = [f"accuracy: {'; '.join(met)}; {spent}"]
    missed = ((step.name, wording.format_decimal(step.reached or 0.0, 2)) for step in judged if step.missed)
    lines += [f"  {name}: error {error}, above tol" for name, error in missed]
    silent = [step for step in steps if step.problem and step.problem not in said]
    return [*lines, *notes, *(f"  no answer from {name_problem(step)}" for step in silent)]


def describe_reached(tol: float, steps: Sequence[Step]) -> str:
    """How many of the stages that were asked for the same error reached it."""
    reached = [step.reached for step in steps if step.reached is not None]
    worst = f", largest error {wording.format_power(max(reached))}" if reached else ""
    met = sum(step.reached is not None and not step.missed for step in steps)
    return f"tol {wording.format_power(tol)} reached in {met} of {counted(len(steps), 'stage')}{worst}"


def name_problem(step: Step) -> str:
    """Why a stage has no answer, with the stage's name before it."""
    return step.problem if step.problem.startswith(step.name) else f"{step.name}: {step.problem}"


def loop_line(loop: Loop, period: float, model: ModelValidity = UNKNOWN) -> str:
    """One loop in one line, with what goes behind its verdict."""
    speed = wording.describe_pace(loop, period)
    figure = "" if loop.verdict in ("undecided", "one-way", "failed") else f", {wording.format_rate(*loop.growth)}"
    weak = wording.doubt(loop, period, model)
    verdict = f"{loop.verdict}, {weak};" if weak else f"{loop.verdict:<10}"
    return f"  {loop.name:<20} {verdict} {speed}{figure}"
