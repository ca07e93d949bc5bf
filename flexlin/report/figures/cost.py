"""Accuracy against time: stage by stage as a picture, as a table, and in words that a user can act on."""

import math
from collections.abc import Iterator
from itertools import islice

from flexlin.analyses.accuracy import CostResult, Row
from flexlin.analyses.accuracy.result import STAGES
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Logarithmic, format_powers_of_ten
from flexlin.precision import EPS
from flexlin.report.figures import DASHES, PARTS, SERIES, SHAPES, Picture, make_picture, resize
from flexlin.report.wording import format_with_prefix
from flexlin.scene.scene import Accuracy

OWN = ("gauss", "radau", "hill")
OUTSIDE = ("DOP853", "Radau")
"""Families of methods with a colour of their own in every panel."""


def draw_cost(result: CostResult) -> Picture:
    """Error across, time up, logarithmic both: transition matrices first, then the other stages, two in a row."""
    stages = [stage for stage in STAGES if result.stage(stage)]
    stages.sort(key=lambda stage: (stage != "transition matrices", STAGES.index(stage)))
    panels = resize([draw_stage(result, stage) for stage in stages], 220.0, 1, 2)
    return make_picture("cost", "What accuracy costs", write_caption(result), panels)


def draw_stage(result: CostResult, stage: str) -> Panel:
    """One line a method from its coarse to its fine settings; outside programs dashed; the engine's own choices as a staircase."""
    shown = [row for row in result.stage(stage) if row.error < 1.0]
    panel = Panel(stage, Logarithmic(), Logarithmic(), "error against the reference", "CPU time in ms")
    rows = [row for row in shown if not row.chosen]
    named: set[str] = set()
    for method in dict.fromkeys(row.method for row in rows):
        mine, name = [row for row in rows if row.method == method], name_family(method)
        colour, shape = style_family(name)
        errors, times = [max(row.error, EPS) for row in mine], [1e3 * row.seconds for row in mine]
        panel.line(errors, times, colour, width=1.2, dash=DASHES[1] if mine[0].outside else "")
        texts, label = [describe_row(row) for row in mine], "" if name in named else name
        panel.dots(errors, times, colour, shape, size=3.0, label=label, texts=texts)
        named.add(name)
    return draw_choices(panel, [row for row in shown if row.chosen])


def draw_choices(panel: Panel, rows: list[Row]) -> Panel:
    """The engine's choices with their tol, joined by a staircase: the least time in which it reaches an error."""
    if not rows:
        return panel
    rows = sorted(rows, key=lambda row: -row.error)
    x, y = [max(row.error, EPS) for row in rows], [1e3 * row.seconds for row in rows]
    least = [min(y[i:]) for i in range(len(y))]
    corners = [(error, time) for i, error in enumerate(x) for time in ([least[i - 1], least[i]] if i else [least[0]])]
    panel.line([error for error, _ in corners], [time for _, time in corners], "ink", width=1.4, dash=DASHES[2])
    texts = [f"tol {row.chosen}: {describe_row(row)}" for row in rows]
    panel.dots(x, y, "ink", "diamond", 4.5, "engine's choice, with its tol", texts)
    left = 0
    while left < len(rows):  # marks that lie close together share their label
        close = [i for i in range(left, len(rows)) if x[left] / x[i] < 3]
        tols = sorted((float(rows[i].chosen) for i in close), reverse=True)
        text = ", ".join(format_powers_of_ten([round(math.log10(tol)) for tol in tols]))
        panel.words(x[left], 1.12 * max(y[i] for i in close), text, colour="ink", halo=True)
        left = close[-1] + 1
    return panel


def style_family(name: str) -> tuple[str, str]:
    """Colour and shape of a family of methods, the same in all panels."""
    if name in OUTSIDE:
        i = OUTSIDE.index(name)
        return PARTS[i], SHAPES[1 + i % (len(SHAPES) - 1)]
    i = OWN.index(name) if name in OWN else len(OWN)
    return SERIES[i], SHAPES[0]


def name_family(method: str) -> str:
    """The method without its order and program, as short as a legend needs it: gauss 8 -> gauss, SciPy Radau -> Radau."""
    name = method.removeprefix("floquet, ").removeprefix("SciPy ")
    return name if name in OUTSIDE else name.rstrip(" 0123456789")


def describe_row(row: Row) -> str:
    """What one sees on pointing at a mark."""
    return f"{row.method}, {row.setting}: error {row.error:.1e}, {1e3 * row.seconds:.3g} ms"


def write_caption(result: CostResult) -> str:
    """How to read the picture."""
    notes = f" {'; '.join(result.notes)}." if result.notes else ""
    agreement = f" Two references of high resolution agree to {result.floor:.0e}; errors below that mean nothing."
    agreement = agreement if math.isfinite(result.floor) else ""
    return (
        "Each mark is one setting of one method: further left is more accurate, lower is faster. Dashed: other programs, their set-up and "
        "compilation left out. Black diamonds: what the engine chooses by itself for each tol; the dotted staircase is the least time in "
        f"which it reaches an error.{agreement}{notes}"
    )


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
    dearest = max(rows, key=lambda row: row.seconds)
    if others and not missed and dearest.seconds < 1.25 * min(row.seconds for row in rows):
        return f"every tol from {first.chosen} to {others[-1].chosen} costs about {describe_time(dearest.seconds)}"
    said = [f"{row.chosen} {describe_time(row.seconds)}{describe_miss(row)}" for row in others]
    return ", ".join([f"tol {first.chosen} costs {describe_time(first.seconds)}{describe_miss(first)}", *said])


def describe_time(seconds: float) -> str:
    """A time with two digits and its unit."""
    return format_with_prefix(float(f"{seconds:.2g}"), "s")


def describe_miss(row: Row) -> str:
    """What was reached where that is less than was asked for."""
    return "" if row.error <= float(row.chosen) else f" (reaches {row.error:.0e})"


def list_settings(result: CostResult) -> Iterator[tuple[str, str, str, Row]]:
    """The cheapest setting for each accuracy, the engine's choice for each tol, and other programs: stage, accuracy, name, row."""
    for stage, accuracy, row in result.recommendations():
        yield stage, f"{accuracy:.0e}", f"{row.method}, {row.setting}", row
    for row in sorted(
        (row for row in result.rows if row.chosen), key=lambda row: (STAGES.index(row.stage), -float(row.chosen))
    ):
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
