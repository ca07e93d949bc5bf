"""Which effects and modes a scene needs: one bar for each change that the audit tried."""

import numpy as np

from flexlin.answers.audit.result import Audit, Row
from flexlin.report.figures.style import Picture
from flexlin.svg import Logarithmic, Named, Panel, draw
from flexlin.svg import Row as Line

TITLE = "Which effects this scene needs"
LEAST, MOST = 1e-6, 2.0
"""Ends of the axis: a change below the first counts as none, one of the verdict reaches the second."""
HEIGHT = 17.0


def draw_effects(audit: Audit) -> Picture:
    """Bars of significance, the largest on top, with the tolerance as a line."""
    rows = [*audit.effects, *audit.modes]
    rows.sort(key=clip_significance)
    panel = Panel(
        x=Logarithmic(LEAST, MOST), y=Named(tuple(row.change for row in rows)), x_label="largest relative change"
    )
    for i, row in enumerate(rows):
        if not np.isnan(row.significance):
            size = max(LEAST, min(clip_significance(row), MOST))
            panel.area(
                [LEAST, size, size, LEAST], [i - 0.3, i - 0.3, i + 0.3, i + 0.3], choose_colour(row, audit.tolerance)
            )
    panel.line([audit.tolerance] * 2, [-0.5, len(rows) - 0.5], "ink", width=1.2, dash="4 3")
    return Picture("effects", TITLE, write_caption(audit), draw([Line([panel], HEIGHT * len(rows))], TITLE))


def clip_significance(row: Row) -> float:
    """What a row is sorted by; a version that could not be judged comes last."""
    return -1.0 if np.isnan(row.significance) else row.significance


def choose_colour(row: Row, tolerance: float) -> str:
    """Blue where the scene's choice is needed, orange where it leaves out what matters, grey below the tolerance."""
    if row.significance <= tolerance:
        return "grid"
    return "blue" if row.on else "orange"


def write_caption(audit: Audit) -> str:
    """How to read the bars, and the advice."""
    findings = [
        f"needed: {', '.join(audit.needed) or 'none'}",
        f"may be dropped: {', '.join(audit.droppable) or 'none'}",
        f"left out although it would be noticed with the figures tried: {', '.join(audit.missing) or 'none'}",
    ]
    return (
        "Each effect switched on or off in turn, each link given a mode more or less: the largest relative change of margin, "
        f"frequencies and tip error. Blue: the scene has it and needs it. Orange: the scene lacks it. Dashed: the tolerance "
        f"{audit.tolerance:g}. At that tolerance {'; '.join(findings)}."
    )
