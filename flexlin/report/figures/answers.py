"""Answers over time to disturbances, linear and nonlinear, and of machines, measured and predicted."""

from typing import Any

import numpy as np

from flexlin.analyses.disturbed import DisturbanceAnswer, NoiseAnswer
from flexlin.checks import Array
from flexlin.identification.maximum_likelihood import Identification
from flexlin.identification.prediction import Prediction, say_fit
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Linear
from flexlin.report.advice import describe_demand
from flexlin.report.figures import CURVE_POINTS, Picture, make_period_panel, make_picture, resize
from flexlin.report.numbers import record_fields
from flexlin.report.wording import format_decimal, format_duration, format_quantity, in_unit, scale_values, with_unit_of
from flexlin.scene.names import name_number
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene


def draw_answer(a: DisturbanceAnswer) -> Picture:
    """All phases faint, the worst one dark, the nonlinear answer beside it; below, settling time by phase."""
    everything, unit = scale_values(a.linear, a.unit)
    factor = float(np.abs(everything).max() / (np.abs(a.linear).max() or 1.0))
    upper = Panel(
        in_unit(a.seen, unit), Linear(0.0, float(a.t[-1])), x_label=in_unit("time after the disturbance", "s")
    )
    upper.zero()
    for k, row in enumerate(everything):
        upper.line(a.t, row, "faint", width=0.6, label="linear, all phases" if k == 0 else "")
    if a.nonlinear is not None:
        upper.line(a.t, factor * a.nonlinear, "blue", width=4.5, opacity=0.5, label="nonlinear, slowest phase")
    upper.line(a.t, everything[a.worst], "ink", dash="5 3", label="linear, slowest phase")
    title = f"{in_unit('settling time', 's')} by phase"
    lower = Panel(title, Linear(0.0, 1.0), x_label="phase t/T of the disturbance")
    shown = np.isfinite(a.settling)
    lower.dots(a.phases[shown], a.settling[shown], "blue", size=2.5)
    panels = resize([upper, lower], 150.0, 1)
    return make_picture("answer", "Answer to a disturbance", describe_answer(a), panels)


def describe_answer(a: DisturbanceAnswer) -> str:
    """The answer in words."""
    longest, least = float(a.settling[a.worst]), float(a.settling.min())
    settles = f"settles to 2 % in {format_duration(longest)}"
    if longest == np.inf:
        settles = f"has not settled after {a.t[-1]:.3g} s"
    others = f"over all phases it settles in {format_duration(least)} at the least"
    largest = format_quantity(float(np.abs(a.linear).max()), a.unit)
    text = (
        f"{a.words}: at the phase that settles last, {a.phases[a.worst]:.3g} of the period, the {a.seen} moves by "
        f"{format_quantity(a.peak, a.unit)}, overshoots by {100 * a.overshoot[a.worst]:.3g} % and {settles}; "
        f"{others if least < np.inf else 'nor has it at any other'}, and moves by {largest} at the most. "
    )
    if a.nonlinear is None:
        return f"{text}There is no nonlinear answer: {a.problem}."
    return f"{text}The nonlinear answer differs by {100 * a.difference:.2g} % of the peak."


def draw_noise(a: NoiseAnswer) -> Picture:
    """The root mean square of the tip over a period, or of the first coordinate without one."""
    known = bool(np.all(np.isfinite(a.tip)))
    values, unit = scale_values(a.tip if known else a.states[:, 0], "m" if known else "")
    title = f"root mean square of the {'tip' if known else 'first coordinate'}"
    panel = make_period_panel(float(a.t[-1]), title, unit).zero().line(a.t, values, "blue")
    return make_picture("answer", "Answer to a disturbance", describe_noise(a), resize([panel], 200.0, 1))


def describe_noise(a: NoiseAnswer) -> str:
    """The answer in words."""
    if not np.all(np.isfinite(a.tip)):
        return f"{a.words}: the first coordinate moves by up to {a.states[:, 0].max():.3g}, root mean square, by the linear equations."
    low, high = (format_quantity(float(v), "m") for v in (a.tip.min(), a.tip.max()))
    return f"{a.words}: the tip moves by {low} to {high} across the last link, root mean square over the period, by the linear equations."


def draw_prediction(found: Prediction) -> Picture:
    """A panel for each column; curves are broken where a window begins."""
    panels = resize([draw_column(found, name) for name in found.fit], 120.0, 1)
    caption = f"Predicted from the inputs alone. {found.status[0].upper()}{found.status[1:]}."
    return make_picture("prediction", "Measured and predicted", caption, panels)


def draw_column(found: Prediction, name: str) -> Panel:
    """One column."""
    ends = Linear(float(found.time[0]), float(found.time[-1]))
    panel = Panel(say_fit(name, found.fit[name]), x=ends, x_label="time in s")
    t, measured = thin_curve(found.time, found.measured[name])
    panel.line(t, measured, "faint", width=3.0, label="measured")
    for k, (start, end) in enumerate(zip(found.starts, [*found.starts[1:], np.inf], strict=True)):
        inside = (found.time >= start) & (found.time < end)
        t, predicted = thin_curve(found.time[inside], found.outputs[name][inside])
        panel.line(t, predicted, "blue", width=1.2, label="" if k else "predicted")
    return panel


def thin_curve(t: Array, values: Array) -> tuple[Array, Array]:
    """So many points of a curve at the most."""
    step = 1 + len(t) // CURVE_POINTS
    return t[::step], values[::step]


def draw_errors(found: Prediction) -> Picture:
    """What is left of each column."""
    ends = Linear(float(found.time[0]), float(found.time[-1]))
    curves = {name: thin_curve(found.time, found.measured[name] - found.outputs[name]) for name in found.fit}
    panels = [Panel(name, x=ends, x_label="time in s").zero().line(*curve, "blue") for name, curve in curves.items()]
    caption = "Measured less predicted; white noise would leave no pattern."
    return make_picture("residuals", "What is left", caption, resize(panels, 80.0, 1))


def say_numbers(scene: Scene, found: Identification) -> list[str]:
    """Each number with one standard error and what it was before, unless its effect is new, then the status."""
    said, new = [], tuple(f"effects.{name}." for name in found.scene.effects.on().keys() - scene.effects.on().keys())
    for path, value in found.values.items():
        error, sure = found.errors[path], np.isfinite(found.errors[path])
        around = f" ± {format_decimal(error, 2)}" if sure else ""
        now = with_unit_of(found.scene, path, f"{format_decimal(value, 5)}{around}")
        now += "" if sure else ", its error is not known"
        was = "" if path.startswith(new) else f"; it was {format_decimal(float(get_value(scene, path)), 5)}"
        said.append(f"{name_number(path)} ({path}): {now}{was}")
    said += [f"{pair}: correlated by {value:.3f}" for pair, value in found.correlations.items()]
    said += ["the errors are one standard error each"] * any(map(np.isfinite, found.errors.values()))
    return [*said, *found.status.split("; ")]


Answer = DisturbanceAnswer | NoiseAnswer


def picture_answer(answer: Answer) -> Picture:
    """The picture of an answer."""
    return draw_noise(answer) if isinstance(answer, NoiseAnswer) else draw_answer(answer)


def answer_lines(answer: Answer) -> list[str]:
    """The answer in words, and which limits of the drives it exceeds."""
    if isinstance(answer, NoiseAnswer):
        return [describe_noise(answer)]
    over = [] if answer.load is None else [d for d in answer.load.exceeded if d.what.startswith("peak")]
    return [describe_answer(answer), *(f"above the drive: {describe_demand(demand)}" for demand in over)]


def answer_record(answer: Answer) -> dict[str, Any]:
    """The answer as data that `to_json` writes."""
    head = {"disturbance": answer.words, **record_fields(answer, "t")}
    if isinstance(answer, NoiseAnswer):
        return head | {"error": answer.error, "rms_states": answer.states, "rms_tip": answer.tip}
    peak = answer.load and np.abs(answer.load.torque).max(axis=0)
    head |= record_fields(answer, "seen unit phases linear settling overshoot peak nonlinear difference problem")
    return head | {"worst_phase": answer.phases[answer.worst], "peak_torque": peak}
