"""Accuracy against time, stage by stage, and the table of the cheapest settings."""

from itertools import islice

from flexlin.answers.accuracy import CostResult, Row
from flexlin.answers.accuracy.result import STAGES
from flexlin.report.figures.style import DASHES, SERIES, SHAPES, Picture
from flexlin.scene.accuracy import Accuracy
from flexlin.svg import Logarithmic, Panel, draw
from flexlin.svg import Row as Panels

TITLE = "What accuracy costs"
UNSEEN = 1e-17
"""An error of exactly zero is drawn here."""


def draw_cost(result: CostResult) -> Picture:
    """Error across, time up, logarithmic both: transition matrices first, then the other stages, two in a row."""
    stages = [stage for stage in STAGES if result.stage(stage)]
    stages.sort(key=lambda stage: (stage != "transition matrices", STAGES.index(stage)))
    panels = [draw_stage(result, stage) for stage in stages]
    rows = [Panels([panels[0]], 360.0)]
    rest = panels[1:]
    rows += [Panels(rest[i : i + 2], 220.0) for i in range(0, len(rest), 2)]
    return Picture("cost", TITLE, write_caption(result), draw(rows, TITLE))


def draw_stage(result: CostResult, stage: str) -> Panel:
    """One line a method from its coarse to its fine settings; outside programs dashed; diamonds: the engine's own choice."""
    panel = Panel(
        stage, x=Logarithmic(), y=Logarithmic(), x_label="error against the reference", y_label="CPU time in ms"
    )
    rows = [row for row in result.stage(stage) if not row.chosen and row.error < 1.0]
    families = list(dict.fromkeys(name_family(row.method) for row in rows))
    named: set[str] = set()
    for method in dict.fromkeys(row.method for row in rows):
        mine, name = [row for row in rows if row.method == method], name_family(method)
        i = families.index(name)
        colour, dash = SERIES[i % len(SERIES)], DASHES[1] if mine[0].outside else ""
        errors, times = [max(row.error, UNSEEN) for row in mine], [1e3 * row.seconds for row in mine]
        panel.line(errors, times, colour, width=1.2, dash=dash)
        texts, label = [describe_row(row) for row in mine], "" if name in named else name
        panel.dots(errors, times, colour, SHAPES[i // len(SERIES) % 3], size=3.0, label=label, texts=texts)
        named.add(name)
    chosen = [row for row in result.stage(stage) if row.chosen and row.error < 1.0]
    if chosen:
        x, y = [max(row.error, UNSEEN) for row in chosen], [1e3 * row.seconds for row in chosen]
        panel.dots(
            x, y, "ink", "diamond", 4.5, "engine's choice", [f"tol {row.chosen}: {describe_row(row)}" for row in chosen]
        )
    return panel


def name_family(method: str) -> str:
    """The method without its order, as short as a legend needs it: gauss 8 -> gauss, CasADi cvodes -> cvodes."""
    name = method.removeprefix("floquet, ").removeprefix("CasADi ").replace("SciPy DOP853", "DOP853")
    return name.rstrip(" 0123456789") if name[0].islower() else name


def describe_row(row: Row) -> str:
    """What one sees on pointing at a mark."""
    return f"{row.method}, {row.setting}: error {row.error:.1e}, {1e3 * row.seconds:.3g} ms"


def write_caption(result: CostResult) -> str:
    """How to read the picture."""
    notes = f" {'; '.join(result.notes)}." if result.notes else ""
    return (
        "Each mark is one setting of one method: further left is more accurate, lower is faster. Dashed: other programs, their set-up and "
        "compilation left out. Black diamonds: what the engine chooses by itself for tol = 1e-4, 1e-6, 1e-8, 1e-10. "
        f"Two references of high resolution agree to {result.floor:.0e}; errors below that mean nothing.{notes}"
    )


def summarise_cost(result: CostResult) -> list[str]:
    """What each tol costs, a line for each stage that takes one: what a user can act on."""
    lines = []
    for stage in STAGES:
        rows = [row for row in result.stage(stage) if row.chosen and row.stage != "transition matrices"]
        if rows:
            costs = ", ".join(f"{row.chosen} costs {describe_time(row.seconds)}{describe_miss(row)}" for row in rows)
            lines.append(f"{stage}: tol {costs}")
    default = f"the default is tol {Accuracy().tol:.0e}; --tol or the scene's [accuracy] changes it"
    return [*lines, default] if lines else []


def describe_time(seconds: float) -> str:
    """A time with two digits and its unit."""
    value, unit = (seconds, "s") if seconds >= 1 else (1e3 * seconds, "ms")
    return f"{float(f'{value:.2g}'):g} {unit}"


def describe_miss(row: Row) -> str:
    """What was reached where that is less than was asked for."""
    return "" if row.error <= float(row.chosen) else f" (reaches {row.error:.0e})"


def cost_table(result: CostResult) -> str:
    """The cheapest setting for each accuracy, the engine's choice for each tol, outside programs, and what a user can act on, as text."""
    lines = [f"{'stage':<20} {'accuracy':>8}  {'cheapest':<34} {'error':>8} {'ms':>9}"]
    for stage, accuracy, row in result.recommendations():
        name = f"{row.method}, {row.setting}"
        lines.append(f"{stage:<20} {accuracy:8.0e}  {name:<34} {row.error:8.1e} {1e3 * row.seconds:9.3f}")
    for row in result.rows:
        if row.chosen:
            name = f"{row.method}, {row.setting}"
            lines.append(
                f"{row.stage:<20} {row.chosen:>8}  engine: {name:<26} {row.error:8.1e} {1e3 * row.seconds:9.3f}"
            )
    outside = [row for row in result.rows if row.outside]
    for method in dict.fromkeys(row.method for row in outside):
        mine = sorted((row for row in outside if row.method == method), key=lambda row: row.error)
        for row in islice(mine, 2):
            name = f"{row.method}, {row.setting}"
            lines.append(f"{'(other programs)':<20} {'':>8}  {name:<34} {row.error:8.1e} {1e3 * row.seconds:9.3f}")
    return "\n".join([*lines, *result.notes, *summarise_cost(result)])
