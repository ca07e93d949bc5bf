"""What matters: the effects and modes that a scene needs, and the numbers that move its growth rate."""

from typing import TYPE_CHECKING

import numpy as np

from flexlin.answers.audit.result import Audit, Row
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Linear, Logarithmic, Named
from flexlin.report.figures.style import WIDTH, Picture, make_picture
from flexlin.report.wording import in_unit

if TYPE_CHECKING:
    import xarray


BAR = 16.0
"""Height of a line."""
LEAST, WHOLE = 1e-6, 2.0
"""Ends of the axis: a change below the first counts as none, one of the verdict reaches the second."""


def draw_effects(audit: Audit) -> Picture:
    """Bars of significance, the largest on top, with the tolerance as a line."""
    rows = [*audit.effects, *audit.modes]
    rows.sort(key=clip_significance)
    panel = Panel(
        x=Logarithmic(LEAST, WHOLE),
        y=Named(tuple(row.change for row in rows)),
        x_label="largest relative change",
        width=WIDTH,
        height=BAR * len(rows),
    )
    for i, row in enumerate(rows):
        if not np.isnan(row.significance):
            size = max(LEAST, min(clip_significance(row), WHOLE))
            panel.area(
                [LEAST, size, size, LEAST], [i - 0.3, i - 0.3, i + 0.3, i + 0.3], colour_need(row, audit.tolerance)
            )
    panel.line([audit.tolerance] * 2, [-0.5, len(rows) - 0.5], "ink", width=1.2, dash="4 3")
    return make_picture("effects", "Which effects this scene needs", describe_findings(audit), [panel] if rows else [])


def clip_significance(row: Row) -> float:
    """What a row is sorted by; a version that could not be judged comes last."""
    return -1.0 if np.isnan(row.significance) else row.significance


def colour_need(row: Row, tolerance: float) -> str:
    """Blue where the scene's choice is needed, orange where it leaves out what matters, grey below the tolerance."""
    if row.significance <= tolerance:
        return "grid"
    return "blue" if row.on else "orange"


def describe_findings(audit: Audit) -> str:
    """How to read the bars, and the advice."""
    nothing = "not known" if audit.problem else "none"
    findings = [
        f"needed: {', '.join(audit.needed) or nothing}",
        f"may be dropped: {', '.join(audit.droppable) or nothing}",
        f"left out although it would be noticed with the figures tried: {', '.join(audit.missing) or nothing}",
    ]
    return (
        "Each effect switched on or off in turn, each link given a mode more or less: the largest relative change of margin, "
        f"frequencies, tip path and torques. Blue: the scene has it and needs it. Orange: the scene lacks it. Dashed: the tolerance "
        f"{audit.tolerance:g}. At that tolerance {'; '.join(findings)}.{audit.problem and f' {audit.problem}.'}"
    )


MOST = 16
PERCENT = (
    "What one percent more of each number does to the largest growth rate of the scene's own loop, by exact derivatives. Green: it settles "
    "faster. Red: slower. Numbers that are zero are left out."
)


def draw_sensitivity(data: "xarray.Dataset") -> Picture:
    """Bars to both sides, the strongest on top."""
    slowest = int(np.argmax(data["exponents"].values.real))
    change = data["percent"].values[:, slowest]
    order = np.argsort(np.abs(change))[-MOST:]
    names = tuple(f"{data['parameter'].values[i]} = {data['value'].values[i]:.4g}" for i in order)
    reach = 1.08 * float(np.abs(change).max()) or 1.0
    label = in_unit("change of the growth rate for 1 % more", "1/s")
    panel = Panel(x=Linear(-reach, reach), y=Named(names), x_label=label, width=WIDTH, height=BAR * len(order))
    for row, i in enumerate(order):
        corners = [0.0, change[i], change[i], 0.0]
        panel.area(corners, [row - 0.3, row - 0.3, row + 0.3, row + 0.3], "stable" if change[i] < 0 else "unstable")
    panel.line([0, 0], [-0.5, len(order) - 0.5], "ink", width=1.0)
    left_out = f" The {len(change) - MOST} that move it least are not shown." if len(change) > MOST else ""
    return make_picture("sensitivity", "Which numbers move the growth rate", PERCENT + left_out, [panel])
