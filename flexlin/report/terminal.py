"""What the command line prints: short, and in colour only on a terminal."""

import sys

from flexlin.answers.analysis import Analysis, Loop
from flexlin.answers.audit import Audit, Row
from flexlin.report.advice import advise
from flexlin.report.wording import describe_pace, format_figures, format_quantity, format_rate

COLOURS = {"stable": "green", "unstable": "red", "undecided": "yellow", "failed": "red"}


def say(text: str = "", verdict: str | None = None) -> None:
    """Print a line; a verdict at its beginning is coloured on a terminal."""
    if verdict is None or not sys.stdout.isatty():
        print(text)
        return
    from rich.console import Console
    from rich.text import Text

    line = Text(text)
    line.highlight_words([verdict], COLOURS[verdict] + " bold")
    Console(highlight=False, soft_wrap=True).print(line)


def summarize(analysis: Analysis) -> None:
    """Print the verdicts and what to do next."""
    say(analysis.scene.title)
    for loop in analysis.loops:
        say(loop_line(loop, analysis.plant.period), loop.verdict)
    for step in advise(analysis):
        say(f"- {step}")


def audit_lines(audit: Audit) -> list[str]:
    """The audit as a table, the most significant change first."""
    head = f"{'change':<30} {'significance':>12} {'margin 1/s':>11} {'frequency':>10} {'tip error':>10} {'instr.':>7}  advice"
    rows = sorted(
        (*audit.effects, *audit.modes),
        key=lambda row: -row.significance if row.significance == row.significance else 1.0,
    )
    tried = [
        f"  {row.subject}: {format_figures(row.table, row.units)}"
        for row in rows
        if row.kind == "effect" and not row.on
    ]
    return [
        head,
        *[format_audit_row(row) for row in rows],
        *(["effects that are off were tried with", *tried] if tried else []),
    ]


def format_audit_row(row: Row) -> str:
    """One change in one line."""
    if row.problem and row.verdict == "unknown":
        return f"{row.change:<30} {row.problem}"
    size = "verdict" if row.significance == float("inf") else f"{row.significance:.2g}"
    tip = "" if row.tip_error != row.tip_error else format_quantity(row.tip_error, "m")
    return f"{row.change:<30} {size:>12} {row.margin:>+11.2g} {row.frequency:>10.2g} {tip:>10} {row.instructions:>+7d}  {row.advice}"


def loop_line(loop: Loop, period: float) -> str:
    """One loop in one line."""
    speed = describe_pace(loop, period)
    figure = "" if loop.verdict in ("undecided", "failed") else f", {format_rate(*loop.growth)}"
    return f"  {loop.name:<20} {loop.verdict:<10} {speed}{figure}"
