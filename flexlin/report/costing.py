"""What accuracy costs, in words that a user can act on, and as a table."""

from collections.abc import Iterator
from itertools import islice

from flexlin.answers.accuracy import CostResult, Row
from flexlin.answers.accuracy.result import STAGES
from flexlin.scene.accuracy import Accuracy

FREE = 1.25
"""Times that differ by less than this factor are the same."""


def summarise_cost(result: CostResult) -> list[str]:
    """What each tol costs, a line for each stage that takes one, and where to change it."""
    lines = []
    for stage in STAGES:
        rows = [row for row in result.stage(stage) if row.chosen and row.stage != "transition matrices"]
        if rows:
            lines.append(f"{stage}: {describe_choices(sorted(rows, key=lambda row: -float(row.chosen)))}")
    default = f"the default is tol {Accuracy().tol:.0e}; --tol or the scene's [accuracy] changes it"
    return [*lines, default] if lines else []


def describe_choices(rows: list[Row]) -> str:
    """Tol 1e-06 costs 12 ms, 1e-10 35 ms; or that all cost the same."""
    first, *others = rows
    missed = any(describe_miss(row) for row in rows)
    if others and not missed and max(row.seconds for row in rows) < FREE * min(row.seconds for row in rows):
        dearest = max(rows, key=lambda row: row.seconds)
        return f"every tol from {first.chosen} to {others[-1].chosen} costs about {describe_time(dearest.seconds)}"
    said = [f"{row.chosen} {describe_time(row.seconds)}{describe_miss(row)}" for row in others]
    return ", ".join([f"tol {first.chosen} costs {describe_time(first.seconds)}{describe_miss(first)}", *said])


def describe_time(seconds: float) -> str:
    """A time with two digits and its unit."""
    value, unit = (seconds, "s") if seconds >= 1 else (1e3 * seconds, "ms")
    return f"{float(f'{value:.2g}'):g} {unit}"


def describe_miss(row: Row) -> str:
    """What was reached where that is less than was asked for."""
    return "" if row.error <= float(row.chosen) else f" (reaches {row.error:.0e})"


def list_settings(result: CostResult) -> Iterator[tuple[str, str, str, Row]]:
    """The cheapest setting for each accuracy, the engine's choice for each tol, and other programs: stage, accuracy, name, row."""
    for stage, accuracy, row in result.recommendations():
        yield stage, f"{accuracy:.0e}", f"{row.method}, {row.setting}", row
    for row in sorted((row for row in result.rows if row.chosen), key=lambda row: STAGES.index(row.stage)):
        yield row.stage, row.chosen, f"engine: {row.method}, {row.setting}", row
    outside = [row for row in result.rows if row.outside]
    for stage, method in dict.fromkeys((row.stage, row.method) for row in outside):
        mine = sorted((row for row in result.stage(stage) if row.method == method), key=lambda row: row.error)
        for row in islice(mine, 2):
            yield stage, "", f"{row.method}, {row.setting}", row


def cost_table(result: CostResult) -> str:
    """The settings as a table, what was left out, and what a user can act on, as text."""
    lines = [f"{'stage':<20} {'accuracy':>8}  {'cheapest':<48} {'error':>8} {'ms':>9}"]
    for stage, accuracy, name, row in list_settings(result):
        lines.append(f"{stage:<20} {accuracy:>8}  {name:<48} {row.error:8.1e} {1e3 * row.seconds:9.3f}")
    return "\n".join([*lines, "", *result.notes, *summarise_cost(result)])
