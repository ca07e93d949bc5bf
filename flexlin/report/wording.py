"""How numbers and verdicts are said, the same on the terminal and on the page."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.analyses.analysis import Analysis
from flexlin.analyses.boundary import CriticalValue, Margin
from flexlin.analyses.clock import Step
from flexlin.analyses.judging import Loop, ModelEvidence, ModelValidity
from flexlin.checks import Array
from flexlin.context import holding
from flexlin.errors import counted
from flexlin.periodic.floquet.result import MARGINAL_GROWTH
from flexlin.plots.scales import SUPERSCRIPTS, write_powers
from flexlin.scene.control import AnyFilter, Control, LowPass, Pid
from flexlin.scene.names import name_number, show_unit
from flexlin.scene.scene import Scene
from flexlin.simulation.result import OUTGROWN

if TYPE_CHECKING:
    from flexlin.analyses.nearest import NearestInstability
    from flexlin.periodic.margins import Margins

UNFELT_PERIODS = 1e5
"""Periods to settle beyond which a decay is not felt."""
ANGLES = ("rad", "mrad", "µrad", "nrad", "°")
NONE = "none"
_length: ContextVar[int | str | None] = ContextVar("length", default=None)
"""The power of ten of the prefix of every deflection on a page, NONE for a scene without dimensions."""


def units_of_scene(scene: Scene, prefix: int | None = None) -> AbstractContextManager[None]:
    """Say each length in the unit that suits it alone, or all by one prefix; without a unit for a scene without dimensions."""
    return holding(_length, NONE if scene.unit_system == "dimensionless" else prefix)


def units_of(analysis: Analysis) -> AbstractContextManager[None]:
    """Say every deflection of a page in one unit, that in which the largest one is readable; in none without dimensions."""
    sizes = [0.0] if analysis.response is None else [*analysis.response.sizes]
    sizes += [0.0 if analysis.simulation is None else analysis.simulation.tip_error]
    largest = max((size for size in sizes if math.isfinite(size)), default=0.0)
    return units_of_scene(analysis.scene, choose_prefix(largest))


def is_dimensionless() -> bool:
    """Whether the page at hand is of a scene without dimensions."""
    return _length.get() == NONE


def page_unit(unit: str) -> str:
    """A unit as the page at hand has it: without dimensions only angles have one."""
    return "" if is_dimensionless() and unit not in ANGLES else unit


def with_unit(text: str, unit: str) -> str:
    """A number as it is written, with its unit behind it, and a proper minus sign."""
    return re.sub(r"(?<!\w)-(?=\d)", "−", f"{text} {page_unit(unit)}".rstrip())


def with_unit_of(scene: Scene, path: str, text: str) -> str:
    """A value of a number of a scene, as it is written, with its unit behind it, and a proper minus sign."""
    return with_unit(text, show_unit(scene, path))


def in_unit(title: str, unit: str) -> str:
    """A title with its unit."""
    return f"{title} in {page_unit(unit)}" if page_unit(unit) else title


def without_units(text: str) -> str:
    """What the engine says, which always counts in SI units, without these where the scene has no dimensions."""
    return re.sub(r"(?<=\d) (?:1/s|rad/s|Hz|s)\b", "", text) if is_dimensionless() else text


def format_quantity(value: float, unit: str, digits: int = 3) -> str:
    """A value with an SI prefix: 0.0123 m -> 12.3 mm; lengths on a page with the page's; without dimensions only angles have a unit."""
    if not page_unit(unit):
        return format_decimal(value, digits) if math.isfinite(value) else "not finite"
    return format_with_prefix(value, unit, digits, page_prefix(unit))


def page_prefix(unit: str) -> int | None:
    """The power of ten of the prefix that the page has for a unit, where it has one."""
    chosen = _length.get()
    return chosen if unit == "m" and isinstance(chosen, int) else None


def format_with_prefix(value: float, unit: str, digits: int = 3, prefix: int | None = None) -> str:
    """A value with a prefix, or the SI prefix that suits it alone, whatever the scene: the processor's seconds, a limit in bytes."""
    if not math.isfinite(value):
        return f"not finite {unit}"
    if value == 0:
        return f"0 {unit}"
    power = choose_prefix(float(f"{value:.{digits}g}")) if prefix is None else prefix
    return f"{format_decimal(value / 10.0**power, digits)} {name_prefix(power)}{unit}"


def scale_values(values: Array, unit: str) -> tuple[Array, str]:
    """Values with the SI prefix that makes the largest readable, and the unit with it."""
    if not page_unit(unit):
        return values, ""
    chosen = page_prefix(unit)
    prefix = choose_prefix(float(np.abs(values).max(initial=0.0))) if chosen is None else chosen
    return values / 10.0**prefix, name_prefix(prefix) + unit


def name_prefix(power: int) -> str:
    """The SI prefix of a power of ten from -9 to 9."""
    return ("n", "µ", "m", "", "k", "M", "G")[power // 3 + 3]


def choose_prefix(value: float) -> int:
    """The power of ten of a value's SI prefix; none for zero and for what is not finite."""
    if value == 0 or not math.isfinite(value):
        return 0
    return min(max(3 * math.floor(math.log10(abs(value)) / 3), -9), 9)


def format_rate(value: float, error: float) -> str:
    """A growth rate with its error: −2.5207 ± 8×10⁻¹⁴ 1/s."""
    return with_unit(f"{format_decimal(value, 5)} ± {format_power(error)}", "1/s")


def format_decimal(value: float, digits: int) -> str:
    """A number to some digits, with a proper minus sign, beyond 99,999 with powers of ten: −3.4474×10⁻⁸, 250."""
    return write_powers(f"{value:.{digits}g}").replace("-", "−")


def format_power(value: float) -> str:
    """A size to one digit, 8×10⁻¹⁴."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    digit, _, exponent = f"{value:.0e}".partition("e")
    return f"{digit}×10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def format_figures(table: dict[str, Any], units: dict[str, str]) -> str:
    """The figures of an effect with their units: mass 0.03 kg, inertia 0 kg m^2."""
    given = {key: value for key, value in table.items() if value is not None}
    said = [f"{key} {format_list(value)} {units.get(key, '')}".rstrip() for key, value in given.items()]
    return ", ".join(said) or "none"


def format_list(value: Any) -> str:
    """A number, or the numbers of a list, to four digits."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {format_list(part)}" for key, part in value.items() if part) or "0"
    values = value if isinstance(value, (list, tuple)) else (value,)
    return ", ".join(format_decimal(v, 4) if isinstance(v, float) else str(v) for v in values)


UNITS = r"(?:1/s|%|°|kg|[nµmkMG]?(?:m|s|N|W|V|A|B|Hz|rad)(?:/\w+)?)(?!\w)"


def typeset(value: Any) -> Any:
    """A text of a page with powers of ten as on paper, and no number parted from its error or unit by the end of a line."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    value = re.sub(r"\^(\d)", lambda found: found[1].translate(SUPERSCRIPTS), write_powers(value))
    return re.sub(rf"(?<=[\d⁰¹²³⁴⁵⁶⁷⁸⁹]) (?={UNITS})|(?<=N) (?=[ms](?!\w))|(?<=±) ", "\u00a0", value)


def describe_pace(loop: Loop, period: float) -> str:
    """What a loop's growth rate means for a disturbance, without the rate itself."""
    growth, error = loop.growth
    if loop.floquet is None:
        return loop.problem
    if abs(growth) <= error:
        return with_unit(f"growth rate zero to within {format_power(error)}", "1/s")
    half = math.log(2) / abs(growth)
    does = "halves" if growth < 0 else "doubles"
    periods = format_decimal(half / period, 2)
    share = "a period" if periods == "1" else f"{periods} {'of a period' if half < period else 'periods'}"
    return f"a disturbance {does} every {format_duration(half)}, {share}"


def caution(loop: Loop, period: float) -> str:
    """What a verdict leaves unsaid where the growth rate is so small that no arm would show it; nothing where it is not."""
    growth, _ = loop.growth
    if loop.verdict not in ("stable", "unstable"):
        return ""
    if abs(growth) * period < MARGINAL_GROWTH:
        return "practically marginal"
    if loop.verdict == "stable" and np.log(50) / -growth > UNFELT_PERIODS * period:
        return f"but it takes {describe_settling(loop)} to settle"
    return ""


def format_duration(seconds: float) -> str:
    """A time in s, or ms, µs ... below one; without unit where the scene has no dimensions."""
    return format_quantity(seconds, "s") if seconds < 1000 else with_unit(format_decimal(seconds, 3), "s")


def describe_settling(loop: Loop) -> str:
    """How long a stable loop takes to settle to 2 %; a dash where it does not."""
    return format_duration(math.log(50) / -loop.growth[0]) if loop.verdict == "stable" else "–"


def describe_tip(loop: Loop) -> str:
    """How far the tip stays from its rigid path in the steady motion that the loop keeps; a dash where that is not known."""
    if loop.response is None or loop.verdict == "unstable" or not np.all(np.isfinite(loop.response.tip)):
        return "–"
    return format_quantity(loop.response.sizes[1], "m")


def format_largest_multiplier(loop: Loop) -> str:
    """The modulus of the largest multiplier, from its logarithm."""
    return "–" if loop.floquet is None else format_modulus(float(loop.floquet.log_multipliers[0].real))


def format_modulus(log: float) -> str:
    """exp(log) as text, however far from 1."""
    if abs(log) < 7:
        return f"{math.exp(log):.4g}"
    exponent, rest = divmod(log / math.log(10), 1.0)
    return f"{10**rest:.3g}×10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def doubt(loop: Loop, period: float, model: ModelValidity) -> str:
    """What goes behind a verdict that is not to be believed as it stands; nothing behind one that is, nor behind an unstable one."""
    if model.verdict == "invalid" and loop.verdict in ("stable", "undecided"):
        return f"{'but' if loop.verdict == 'stable' else 'and'} the linear model does not hold here"
    return caution(loop, period)


def colour(loop: Loop, period: float, model: ModelValidity) -> str:
    """The class of a loop's verdict: that of doubt where there is one."""
    return "undecided" if doubt(loop, period, model) else loop.verdict


def loop_line(loop: Loop, period: float, model: ModelValidity) -> str:
    """One loop in one line, with what goes behind its verdict."""
    speed = describe_pace(loop, period)
    figure = "" if loop.verdict in ("undecided", "one-way", "failed") else f", {format_rate(*loop.growth)}"
    weak = doubt(loop, period, model)
    verdict = f"{loop.verdict}, {weak};" if weak else f"{loop.verdict:<10}"
    return f"  {loop.name:<20} {verdict} {speed}{figure}"


def accuracy_lines(steps: Sequence[Step], said: str = "") -> list[str]:
    """What was asked, what was reached, what it took: one line, and one for each stage that missed or has no answer that was not `said`."""
    judged = [step for step in steps if step.asked is not None]
    total, cpu = (format_with_prefix(seconds, "s") for seconds in took(steps))
    spent = f"took {total} ({cpu} of a processor)"
    notes = [f"  {step.name}: {note}" for step in steps for note in step.notes]
    if not judged:
        return [spent, *notes]
    asked = dict.fromkeys(step.asked or 0.0 for step in judged)
    met = [describe_reached(tol, [step for step in judged if step.asked == tol]) for tol in asked]
    lines = [f"accuracy: {'; '.join(met)}; {spent}"]
    missed = ((step.name, format_decimal(step.reached or 0.0, 2)) for step in judged if step.missed)
    lines += [f"  {name}: error {error}, above tol" for name, error in missed]
    silent = [step for step in steps if step.problem and step.problem not in said]
    return [*lines, *notes, *(f"  no answer from {name_problem(step)}" for step in silent)]


def took(steps: Sequence[Step]) -> tuple[float, float]:
    """The seconds of all stages, by the clock and of a processor."""
    return sum(step.seconds for step in steps), sum(step.cpu_seconds for step in steps)


def describe_reached(tol: float, steps: Sequence[Step]) -> str:
    """How many of the stages that were asked for the same error reached it."""
    reached = [step.reached for step in steps if step.reached is not None]
    worst = f", largest error {format_power(max(reached))}" if reached else ""
    met = sum(step.reached is not None and not step.missed for step in steps)
    return f"tol {format_power(tol)} reached in {met} of {counted(len(steps), 'stage')}{worst}"


def name_problem(step: Step) -> str:
    """Why a stage has no answer, with the stage's name before it."""
    return step.problem if step.problem.startswith(step.name) else f"{step.name}: {step.problem}"


def reason(validity: ModelValidity) -> str:
    """The figure that speaks against the linear model, in words; nothing where none does."""
    return "" if validity.reason is None else describe_evidence(validity.reason)


def describe_evidence(found: ModelEvidence) -> str:
    """One figure in words."""
    size = format_quantity(found.value, found.unit).rstrip()
    share, linear = f"{size}, {100 * found.share:.3g} %", "by the linear answer its"
    if found.what == "difference" and not math.isfinite(found.value):
        return OUTGROWN
    return {
        "bending": f"{linear} links bend by {share} of the arm's length, too far for linear equations",
        "tip": f"{linear} tip is {share} of the arm's length, away from its rigid path, and deflections must be small",
        "difference": f"the linear answer misses the nonlinear one by {share} of the largest deviation",
        "stopped": f"the nonlinear equations lose their meaning after {format_quantity(found.bound, 's')}",
    }[found.what]


PLACES = {"torque": "on the torque", "rates": "on the measured rates"}


def describe_controller(control: Control) -> str:
    """Integral action and filters of the scene's own loop, and what of its drive the linear verdict leaves out."""
    pid, limits, parts = control.feedback, control.saturation, list[str]()
    if isinstance(pid, Pid) and any(pid.ki):
        unwound = "" if pid.tracking_time is None else f", unwound within {format_quantity(pid.tracking_time, 's')}"
        parts.append(f"integral action{unwound}")
    parts += map(describe_filter, control.filters)
    said = [f"with {', '.join(parts)}"] if parts else []
    if limits is not None:
        rate = "" if limits.rate is None else " and limits of the torque's rate"
        said.append(f"torque limits{rate} act in the simulation only")
    return "; ".join(said)


def describe_filter(one: AnyFilter) -> str:
    """One filter: low-pass of order 2 at 200 Hz on the torque of joint 1."""
    if isinstance(one, LowPass):
        what = f"low-pass of order {one.order} at {format_quantity(one.cutoff, 'Hz')}"
    else:
        what = f"notch at {format_quantity(one.frequency, 'Hz')}"
    of = "" if one.joints is None else f" of joint {', '.join(map(str, one.joints))}"
    return f"{what} {PLACES[one.on]}{of}"


CRITICAL_DIGITS = 4
"""Of a critical value."""
FEW = 5
"""Values of a search that had to end from which on its gaps say something."""
SEARCHED = "margin "
"""What the keys of problems with critical values begin with; the number's path follows."""


def describe_margins(scene: Scene, margins: tuple[Margin, ...], problems: Mapping[str, str] | None = None) -> str:
    """Becomes unstable at a motion frequency of 1.37 Hz (now 0.5) and at a payload mass of 0.41 kg (now 0.03).

    Numbers whose search met a limit, by the problems or after FEW values, are named: of them nothing more is known.
    """
    met = [(margin, margin.nearest) for margin in margins]
    parts = []
    for change, words in (("onset", "becomes unstable"), ("recovery", "is no longer unstable")):
        # on the way from the scene's own value to the critical one and beyond
        ahead = [(m, one) for m, one in met if one and (change == one.kind) == (one.value > m.own)]
        said = [describe_place(scene, margin, one) for margin, one in ahead]
        parts += [f"{words} {' and '.join(said)}"] if said else []
    whole = [margin for margin, one in met if one is None and not margin.gap]
    kept = [with_unit_of(scene, m.path, f"a {name_number(m.path)} {say_ends(m.low, m.high)}") for m in whole]
    parts += [f"keeps its verdict for {' and '.join(kept)}"] if kept else []
    gaps = [describe_gap(scene, margin, one) for margin, one in met if margin.gap and margin.values >= FEW]
    left = [margin.path for margin in margins if margin.gap and margin.values < FEW]
    left += [key.removeprefix(SEARCHED) for key in problems or {} if key.startswith(SEARCHED)]
    few = f"was not searched to the end over {' and '.join(map(name_number, left))}, of which nothing more is said"
    parts += gaps + [few] * bool(left)
    parts += ["ask for a narrower range (--margins) or more time (--limit-seconds)"] * bool(gaps or left)
    return "; ".join(parts)


def describe_place(scene: Scene, margin: Margin, one: CriticalValue) -> str:
    """At a motion frequency of 1.37 Hz (now 0.5); both ends of what is known where they differ in what is said of them."""
    ends = np.clip([one.value - one.error, one.value + one.error], margin.low, margin.high)
    low, high = (format_decimal(end, CRITICAL_DIGITS) for end in ends.tolist())
    where = f"of {high}" if low == high else f"between {low} and {high}"
    return f"at {say_value(scene, margin.path, where, margin.own)}"


def say_value(scene: Scene, path: str, where: str, own: float) -> str:
    """A motion frequency of 1.37 Hz (now 0.5)."""
    return f"{with_unit_of(scene, path, f'a {name_number(path)} {where}')} (now {format_decimal(own, CRITICAL_DIGITS)})"


def describe_gap(scene: Scene, margin: Margin, one: CriticalValue | None) -> str:
    """Shows no change at 9 values of the motion frequency from 0.1 to 2 Hz that time allowed, which leave gaps of up to 0.3 Hz."""
    tried = "no other change" if one is not None else "the same verdict"
    gap = with_unit_of(scene, margin.path, format_decimal(margin.gap, 3))
    where = with_unit_of(scene, margin.path, f"{name_number(margin.path)} {say_ends(margin.low, margin.high)}")
    low, high = max(margin.low, margin.searched[0]), min(margin.high, margin.searched[1])
    known = f", but none {say_ends(low, high)}" if low < high else ""
    return f"shows {tried} at the {margin.values} values of {where} that time allowed, which leave gaps of up to {gap}{known}"


def say_ends(low: float, high: float) -> str:
    """From 0.1 to 2."""
    return f"from {format_decimal(low, CRITICAL_DIGITS)} to {format_decimal(high, CRITICAL_DIGITS)}"


def describe_nearest(scene: Scene, found: "NearestInstability | None") -> str:
    """What the uncertain numbers may do to the loop; empty where nobody asked."""
    if found is None:
        return ""
    least, most = found.growth
    spread = with_unit(f"growth rates within the stated ranges from {least:.4g} to {most:.4g}", "1/s")
    if not math.isfinite(found.scale):
        return f"{found.status}; {spread}"
    numbers = zip(found.paths, found.values, found.own, strict=True)
    places = (
        say_value(scene, path, f"of {format_decimal(value, CRITICAL_DIGITS)}", own) for path, value, own in numbers
    )
    return f"{found.status}, at {' and '.join(places)}; {spread}"


def describe_endured(found: "Margins | None") -> str:
    """Gain 0.126 to ∞, phase 48°, delay 2.44 ms; a dash where nothing is known."""
    if found is None:
        return "–"

    def say(value: float, how: Callable[[float], str], unlimited: str) -> str:
        return how(value) if math.isfinite(value) else "unknown" if math.isnan(value) else unlimited

    low, high = (say(one, lambda factor: format_decimal(factor, 3), "∞") for one in found.gain)
    phase = say(found.phase, lambda angle: f"{format_decimal(math.degrees(angle), 3)}°", "any")
    return f"gain {low} to {high}, phase {phase}, delay {say(found.delay, format_duration, 'any')}"
