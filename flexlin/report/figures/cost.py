"""Accuracy against time, stage by stage."""

import math

from flexlin.answers.accuracy import CostResult, Row
from flexlin.answers.accuracy.result import STAGES
from flexlin.report.figures.style import DASHES, PARTS, SERIES, SHAPES, Picture, make_picture
from flexlin.svg import Logarithmic, Panel
from flexlin.svg import Row as Panels
from flexlin.svg.scales import format_power_of_ten

UNSEEN = 1e-17
"""An error of exactly zero is drawn here."""
ROOM, CLOSE, ABOVE = 5.0, 3.0, 1.12
"""Factors: room at the ends of the errors, errors of marks that share a label, and how far above a mark it stands."""
OWN = ("gauss", "radau", "hill")
OUTSIDE = ("DOP853", "LSODA", "Radau")
"""Families of methods with a colour of their own in every panel."""


def draw_cost(result: CostResult) -> Picture:
    """Error across, time up, logarithmic both: transition matrices first, then the other stages, two in a row."""
    stages = [stage for stage in STAGES if result.stage(stage)]
    stages.sort(key=lambda stage: (stage != "transition matrices", STAGES.index(stage)))
    panels = [draw_stage(result, stage) for stage in stages]
    rows = [Panels([panels[0]], 360.0)] if panels else []
    rows += [Panels(panels[i : i + 2], 200.0, (1.0, 1.0)) for i in range(1, len(panels), 2)]
    return make_picture("cost", "What accuracy costs", write_caption(result), rows)


def draw_stage(result: CostResult, stage: str) -> Panel:
    """One line a method from its coarse to its fine settings; outside programs dashed; the engine's own choices as a staircase."""
    shown = [row for row in result.stage(stage) if row.error < 1.0]
    errors = [max(row.error, UNSEEN) for row in shown] or [1.0]
    scale = Logarithmic(min(errors) / ROOM, max(errors) * ROOM)
    panel = Panel(stage, x=scale, y=Logarithmic(), x_label="error against the reference", y_label="CPU time in ms")
    rows = [row for row in shown if not row.chosen]
    named: set[str] = set()
    for method in dict.fromkeys(row.method for row in rows):
        mine, name = [row for row in rows if row.method == method], name_family(method)
        colour, shape = style_family(name)
        errors, times = [max(row.error, UNSEEN) for row in mine], [1e3 * row.seconds for row in mine]
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
    x, y = [max(row.error, UNSEEN) for row in rows], [1e3 * row.seconds for row in rows]
    least = [min(y[i:]) for i in range(len(y))]
    corners = [(error, time) for i, error in enumerate(x) for time in ([least[i - 1], least[i]] if i else [least[0]])]
    panel.line([error for error, _ in corners], [time for _, time in corners], "ink", width=1.4, dash=DASHES[2])
    texts = [f"tol {row.chosen}: {describe_row(row)}" for row in rows]
    panel.dots(x, y, "ink", "diamond", 4.5, "engine's choice, with its tol", texts)
    left = 0
    while left < len(rows):  # marks that lie close together share their label
        close = [i for i in range(left, len(rows)) if x[left] / x[i] < CLOSE]
        tols = sorted((float(rows[i].chosen) for i in close), reverse=True)
        text = ", ".join(format_power_of_ten(round(math.log10(tol))) for tol in tols)
        panel.words(x[left], ABOVE * max(y[i] for i in close), text, colour="ink", halo=True)
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
    """The method without its order and program, as short as a legend needs it: gauss 8 -> gauss, CasADi cvodes -> cvodes."""
    name = method.removeprefix("floquet, ").removeprefix("CasADi ").removeprefix("SciPy ")
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
