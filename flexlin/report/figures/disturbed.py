"""What a disturbance does: the linear answer at every phase, the nonlinear one at the worst."""

import numpy as np

from flexlin.answers.disturbed.noise import NoiseAnswer
from flexlin.answers.disturbed.respond import DisturbanceAnswer
from flexlin.report.figures.style import Picture, make_period_panel
from flexlin.report.wording import format_duration, format_quantity, in_unit, scale_values
from flexlin.svg import Linear, Panel, Row, draw

TITLE = "Answer to a disturbance"


def draw_answer(a: DisturbanceAnswer) -> Picture:
    """All phases faint, the worst one dark, the nonlinear answer beside it; below, settling time by phase."""
    everything, unit = scale_values(a.linear, a.unit)
    factor = float(np.abs(everything).max() / (np.abs(a.linear).max() or 1.0))
    upper = Panel(
        in_unit(a.seen, unit), x=Linear(0.0, float(a.t[-1])), x_label=in_unit("time after the disturbance", "s")
    ).zero()
    for k, row in enumerate(everything):
        upper.line(a.t, row, "faint", width=0.6, label="linear, all phases" if k == 0 else "")
    if a.nonlinear is not None:
        upper.line(a.t, factor * a.nonlinear, "blue", width=4.5, opacity=0.5, label="nonlinear, worst phase")
    upper.line(a.t, everything[a.worst], "ink", dash="5 3", label="linear, worst phase")
    lower = Panel(
        f"{in_unit('settling time', 's')} by phase", x=Linear(0.0, 1.0), x_label="phase t/T of the disturbance"
    )
    shown = np.isfinite(a.settling)
    lower.dots(a.phases[shown], a.settling[shown], "blue", size=2.5)
    return Picture("answer", TITLE, describe_answer(a), draw([Row([upper], 200), Row([lower], 90)], TITLE))


def describe_answer(a: DisturbanceAnswer) -> str:
    """The answer in words."""
    settled = a.settling[a.worst]
    when = (
        f"settles to 2 % in {format_duration(settled)}"
        if np.isfinite(settled)
        else f"has not settled after {a.t[-1]:.3g} s"
    )
    text = (
        f"{a.words}: at the worst phase, {a.phases[a.worst]:.3g} of the period, the {a.seen} moves by {format_quantity(a.peak, a.unit)}, "
        f"overshoots by {100 * a.overshoot[a.worst]:.3g} % and {when}; over all phases settling takes "
        f"{format_duration(float(a.settling.min()))} at the least. "
    )
    if a.nonlinear is None:
        return f"{text}There is no nonlinear answer: {a.problem}."
    return f"{text}The nonlinear answer differs by {100 * a.difference:.2g} % of the peak."


def draw_noise(a: NoiseAnswer) -> Picture:
    """The root mean square of the tip over a period, or of the first coordinate without one."""
    known = bool(np.all(np.isfinite(a.tip)))
    values, unit = scale_values(a.tip if known else a.states[:, 0], "m" if known else "")
    panel = make_period_panel(
        float(a.t[-1]), in_unit(f"root mean square of the {'tip' if known else 'first coordinate'}", unit)
    ).zero()
    panel.line(a.t, values, "blue")
    return Picture("answer", TITLE, describe_noise(a), draw([Row([panel], 200)], TITLE))


def describe_noise(a: NoiseAnswer) -> str:
    """The answer in words."""
    if not np.all(np.isfinite(a.tip)):
        return f"{a.words}: the first coordinate moves by up to {a.states[:, 0].max():.3g}, root mean square, by the linear equations."
    low, high = (format_quantity(float(v), "m") for v in (a.tip.min(), a.tip.max()))
    return f"{a.words}: the tip moves by {low} to {high} across the last link, root mean square over the period, by the linear equations."
