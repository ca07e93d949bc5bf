"""The figures of the report, one file each."""

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure

from flexlin.report.analysis import Analysis
from flexlin.report.figures.arm import draw_arm
from flexlin.report.figures.coefficients import draw_coefficients
from flexlin.report.figures.comparison import draw_comparison
from flexlin.report.figures.exponents import draw_exponents
from flexlin.report.figures.gains import draw_gains
from flexlin.report.figures.multipliers import draw_multipliers
from flexlin.report.figures.response import draw_response
from flexlin.report.figures.style import Picture, inline_picture
from flexlin.report.figures.tip import draw_tip

Drawing = tuple[Figure, str, str]
"""A figure, its title and its caption."""

FIGURES: dict[str, Callable[[Analysis], Drawing | None]] = {
    "multipliers": draw_multipliers,
    "arm": draw_arm,
    "tip": draw_tip,
    "response": draw_response,
    "comparison": draw_comparison,
    "exponents": draw_exponents,
    "coefficients": draw_coefficients,
    "gains": draw_gains,
}


def pictures(analysis: Analysis) -> list[Picture]:
    """All figures that this analysis has numbers for, in the order of the page."""
    drawn = [inline_picture(name, partial(draw, analysis)) for name, draw in FIGURES.items()]
    return [picture for picture in drawn if picture is not None]
