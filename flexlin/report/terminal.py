"""What the command line prints: short, and in colour only on a terminal."""

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from flexlin.answers.analysis import Analysis
from flexlin.answers.clock import Step
from flexlin.answers.judging import Loop
from flexlin.answers.validity import ModelValidity
from flexlin.errors import counted
from flexlin.report.advice import advise
from flexlin.report.margins import describe_margins, describe_nearest
from flexlin.report.wording import (
    colour,
    describe_pace,
    doubt,
    drive_line,
    format_decimal,
    format_figures,
    format_power,
    format_quantity,
    format_rate,
    format_with_prefix,
    units_of,
)

if TYPE_CHECKING:
    from flexlin.answers.audit.figures import Measure
    from flexlin.answers.audit.result import Audit, Row

UNKNOWN = ModelValidity("unknown")
COLOURS = {"stable": "green", "unstable": "red", "undecided": "yellow", "one-way": "yellow", "failed": "red"}


def say(text: str = "", verdict: str | None = None, shade: str | None = None) -> None:
    """Print a line; a verdict at its beginning is coloured on a terminal."""
    if verdict is None or not sys.stdout.isatty():
        print(text)
        return
    from rich.console import Console
    from rich.text import Text

    line = Text(text)
    line.highlight_words([verdict], (shade or COLOURS[verdict]) + " bold")
    Console(highlight=False, soft_wrap=True).print(line)


def say_loop(loop: Loop, period: float, model: ModelValidity = UNKNOWN) -> None:
    """Print the verdict on a loop, in the colour of doubt where there is one."""
    shown = colour(loop, period, model)
    say(loop_line(loop, period, model), loop.verdict, COLOURS[shown])


def summarize(analysis: Analysis) -> None:
    """Print the verdicts and what to do next."""
    with units_of(analysis):
        say_all(analysis)


def say_all(analysis: Analysis) -> None:
    """Print it in the units of the analysis."""
    say(analysis.scene.title)
    for loop in analysis.loops:
        say_loop(loop, analysis.plant.period, analysis.validity(loop))
        over = drive_line(analysis, loop)
        if over:
            say(f"    {over}")
    if critical := describe_margins(analysis.scene, analysis.margins, analysis.problems):
        say(f"  {analysis.own.name} {critical}")
    if analysis.nearest:
        say(f"  {analysis.own.name} with its uncertain numbers: {describe_nearest(analysis.scene, analysis.nearest)}")
    said = advise(analysis)
    for line in (*[f"- {step}" for step in said], *accuracy_lines(analysis.steps, "\n".join(said))):
        say(line)


def accuracy_lines(steps: Sequence[Step], said: str = "") -> list[str]:
    """What was asked, what was reached, what it took: one line, and one for each stage that missed or has no answer that was not `said`."""
    judged = [step for step in steps if step.asked is not None]
    total, cpu = sum(step.seconds for step in steps), sum(step.cpu_seconds for step in steps)
    took = f"{format_with_prefix(total, 's')} ({format_with_prefix(cpu, 's')} of a processor)"
    notes = [f"  {step.name}: {note}" for step in steps for note in step.notes]
    if not judged:
        return [f"took {took}", *notes]
    asked = dict.fromkeys(step.asked or 0.0 for step in judged)
    met = [describe_reached(tol, [step for step in judged if step.asked == tol]) for tol in asked]
    lines = [f"accuracy: {'; '.join(met)}; took {took}"]
    lines += [
        f"  {step.name}: error {format_decimal(step.reached or 0.0, 2)}, above tol" for step in judged if step.missed
    ]
    return [*lines, *notes] + [
        f"  no answer from {name_problem(step)}" for step in steps if step.problem and step.problem not in said
    ]


def describe_reached(tol: float, steps: Sequence[Step]) -> str:
    """How many of the stages that were asked for the same error reached it."""
    reached = [step.reached for step in steps if step.reached is not None]
    worst = f", largest error {format_power(max(reached))}" if reached else ""
    met = sum(step.reached is not None and not step.missed for step in steps)
    return f"tol {format_power(tol)} reached in {met} of {counted(len(steps), 'stage')}{worst}"


def name_problem(step: Step) -> str:
    """Why a stage has no answer, with the stage's name before it."""
    return step.problem if step.problem.startswith(step.name) else f"{step.name}: {step.problem}"


def audit_lines(audit: "Audit") -> list[str]:
    """The audit as a table, the most significant change first; the figures of the effects; pairs; the smallest scene that is enough."""
    head = f"{'change':<30} {'significance':>12} {'margin 1/s':>11} {'frequency':>10} {'tip path':>9} {'torque':>9} {'instr.':>7}  advice"
    rows = sorted(
        (*audit.effects, *audit.modes),
        key=lambda row: -row.significance if row.significance == row.significance else 1.0,
    )
    figures = {
        words: [
            f"  {row.subject}: {format_figures(row.table, row.units)}"
            for row in rows
            if row.kind == "effect" and row.on is on
        ]
        for on, words in (
            (True, "effects of the scene, with its figures"),
            (False, "effects that are off were tried with"),
        )
    }
    pairs = [f"  {row.subject}: {row.advice}, {format_size(row)}" for row in audit.pairs]
    return [
        head,
        *[format_audit_row(row) for row in rows],
        describe_base(audit.base),
        *[line for words, lines in figures.items() if lines for line in (words, *lines)],
        *(["two effects at once", *pairs] if pairs else []),
        *minimal_lines(audit),
    ]


def describe_base(base: "Measure") -> str:
    """The scene's own figures."""
    frequencies = ", ".join(f"{value / 6.283185307179586:.3g}" for value in base.frequencies[:4])
    tip = "" if base.tip_error != base.tip_error else f", tip error {format_quantity(base.tip_error, 'm')}"
    return f"the scene: {base.verdict}, {format_rate(base.margin, base.margin_error)}; natural frequencies {frequencies} Hz{tip}"


def minimal_lines(audit: "Audit") -> list[str]:
    """The smallest scene that was found to be enough."""
    if audit.minimal is None:
        return [audit.problem] if audit.problem else []
    from flexlin.report.minimal import describe_error

    found = audit.minimal
    changes = [*(f"drop: {text}" for text in found.dropped), *(f"add: {text}" for text in found.added)]
    size = f"{counted(found.coordinates, 'coordinate')} in the place of {audit.base.coordinates}"
    return [
        f"minimal scene, {size}, error {describe_error(found.error)}",
        *(f"  {text}" for text in changes or ["nothing to drop"]),
    ]


def format_size(row: "Row") -> str:
    """The significance of a row."""
    return name_change(row) if row.significance == float("inf") else f"{row.significance:.2g} together"


def name_change(row: "Row") -> str:
    """What is another one, where no number says how much."""
    return f"other marks of the drives: {', '.join(row.marks)}" if row.marks else "another verdict"


def format_audit_row(row: "Row") -> str:
    """One change in one line."""
    if row.problem and row.verdict == "unknown":
        return f"{row.change:<30} {row.problem}"
    size = f"{row.significance:.2g}" if row.significance < float("inf") else "drive marks" if row.marks else "verdict"
    shares = f"{row.frequency:>10.2g} {row.path:>9.2g} {row.torque:>9.2g}"
    return f"{row.change:<30} {size:>12} {row.margin:>+11.2g} {shares} {row.instructions:>+7d}  {row.advice}"


def loop_line(loop: Loop, period: float, model: ModelValidity = UNKNOWN) -> str:
    """One loop in one line, with what goes behind its verdict."""
    speed = describe_pace(loop, period)
    figure = "" if loop.verdict in ("undecided", "one-way", "failed") else f", {format_rate(*loop.growth)}"
    weak = doubt(loop, period, model)
    verdict = f"{loop.verdict}, {weak};" if weak else f"{loop.verdict:<10}"
    return f"  {loop.name:<20} {verdict} {speed}{figure}"
