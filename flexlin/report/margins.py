"""What is said of the values at which a loop changes its verdict, and of the gain, phase and delay that it endures."""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from flexlin.answers.critical_values import CriticalValue, Margin
from flexlin.report.wording import format_decimal, format_duration
from flexlin.scene.names import name_number, show_unit
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    from flexlin.answers.nearest import NearestInstability
    from flexlin.periodic.margins import Margins

DIGITS, ROUGH = 4, 5e-4
"""Digits of a critical value, and the relative error from which both ends of what is known are said."""


SEARCHED = "margin "
"""What the keys of problems with critical values begin with; the number's path follows."""


def describe_margins(scene: Scene, margins: tuple[Margin, ...], problems: Mapping[str, str] | None = None) -> str:
    """Becomes unstable at a motion frequency of 1.37 Hz (now 0.5) and at a payload mass of 0.41 kg (now 0.03).

    Numbers whose search met a limit, by the problems, are named: of them nothing is known.
    """
    met = [(margin, margin.nearest) for margin in margins]
    parts = []
    for change, words in (("onset", "becomes unstable"), ("recovery", "becomes stable")):
        said = [describe_place(scene, margin, one) for margin, one in met if one and leads_to(margin, one) == change]
        parts += [f"{words} {' and '.join(said)}"] if said else []
    kept = [
        describe_range(scene, margin) for margin, one in met if one is None and margin.searched[0] < margin.searched[1]
    ]
    parts += [f"keeps its verdict for {' and '.join(kept)}"] if kept else []
    parts += [describe_gap(scene, margin, one) for margin, one in met if margin.gap]
    left = [name_number(key.removeprefix(SEARCHED)) for key in problems or {} if key.startswith(SEARCHED)]
    parts += [f"was not searched to the end over {' and '.join(left)}, of which nothing is said"] if left else []
    return "; ".join(parts)


def leads_to(margin: Margin, one: CriticalValue) -> str:
    """What happens on the way from the scene's own value to a critical one and beyond."""
    upward = one.value > margin.own
    return "onset" if upward == (one.kind == "onset") else "recovery"


def describe_place(scene: Scene, margin: Margin, one: CriticalValue) -> str:
    """At a motion frequency of 1.37 Hz (now 0.5)."""
    unit, now = show_unit(scene, margin.path), format_decimal(margin.own, DIGITS)
    if one.error > ROUGH * abs(one.value):
        ends = " and ".join(format_decimal(one.value + side, DIGITS) for side in (-one.error, one.error))
        return f"at a {name_number(margin.path)} between {ends} {unit}".strip() + f" (now {now})"
    return f"at a {name_number(margin.path)} of {format_decimal(one.value, DIGITS)} {unit}".strip() + f" (now {now})"


def describe_gap(scene: Scene, margin: Margin, one: CriticalValue | None) -> str:
    """Shows no change at 9 values of the motion frequency from 0.1 to 2 Hz, of which nothing is known in gaps of up to 0.3 Hz."""
    tried = "no other change" if one is not None else "the same verdict"
    ends = f"{format_decimal(margin.low, DIGITS)} to {format_decimal(margin.high, DIGITS)}"
    gap = f"{format_decimal(margin.gap, 2)} {show_unit(scene, margin.path)}".strip()
    where = f"{name_number(margin.path)} from {ends} {show_unit(scene, margin.path)}".strip()
    return f"shows {tried} at the {margin.values} values of {where} that time allowed, which leave gaps of up to {gap}"


def describe_range(scene: Scene, margin: Margin) -> str:
    """A motion frequency from 0.1 to 2 Hz: what was searched without gaps."""
    low, high = max(margin.low, margin.searched[0]), min(margin.high, margin.searched[1])
    ends = f"{format_decimal(low, DIGITS)} to {format_decimal(high, DIGITS)}"
    return f"a {name_number(margin.path)} from {ends} {show_unit(scene, margin.path)}".strip()


def describe_nearest(scene: Scene, found: "NearestInstability | None") -> str:
    """What the uncertain numbers may do to the loop; empty where nobody asked."""
    if found is None:
        return ""
    spread = (
        "growth rates within the stated ranges from " + " to ".join(f"{rate:.4g}" for rate in found.growth) + " 1/s"
    )
    if not math.isfinite(found.scale):
        return f"{found.status}; {spread}"
    places = (
        f"a {name_number(path)} of {format_decimal(value, DIGITS)} {show_unit(scene, path)}".strip()
        + f" (now {format_decimal(own, DIGITS)})"
        for path, value, own in zip(found.paths, found.values, found.own, strict=True)
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
