"""The figures of the report, one file each."""

from collections.abc import Callable, Iterator

from flexlin.answers.analysis import Analysis
from flexlin.report.figures.arm import draw_arm, draw_modes
from flexlin.report.figures.exponents import draw_exponents, draw_multipliers
from flexlin.report.figures.over_period import draw_coefficients, draw_comparison, draw_gains, draw_response, draw_tip
from flexlin.report.figures.style import Picture
from flexlin.report.wording import units_of

FIGURES: tuple[Callable[[Analysis], Picture | None], ...] = (
    draw_multipliers,
    draw_arm,
    draw_tip,
    draw_response,
    draw_comparison,
    draw_exponents,
    draw_modes,
    draw_coefficients,
    draw_gains,
)


def draw_pictures(analysis: Analysis) -> Iterator[Picture]:
    """All figures that this analysis has numbers for, in the order of the page."""
    with units_of(analysis):
        yield from (picture for draw in FIGURES if (picture := draw(analysis)) is not None)
        if analysis.sensitivity is not None:
            from flexlin.report.audit import draw_sensitivity

            yield draw_sensitivity(analysis.sensitivity)
    if analysis.audit is not None:
        from flexlin.report.audit import draw_effects

        yield draw_effects(analysis.audit)
