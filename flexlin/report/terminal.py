"""What the command line prints: short, and in colour only on a terminal."""

import sys

from flexlin.report.advice import next_steps
from flexlin.report.analysis import Analysis, Loop
from flexlin.report.wording import pace, rate

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
    for step in next_steps(analysis):
        say(f"- {step}")


def loop_line(loop: Loop, period: float) -> str:
    """One loop in one line."""
    told = pace(loop, period)
    figure = "" if loop.verdict in ("undecided", "failed") else f", {rate(*loop.growth)}"
    return f"  {loop.name:<18} {loop.verdict:<10} {told}{figure}"
