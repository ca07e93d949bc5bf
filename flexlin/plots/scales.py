"""Scales of axes: from values to the unit interval, with ticks at round numbers."""

import math
import re
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
PLAIN = 5
"""Powers of ten below this are written out."""
ROUND = (1.0, 2.0, 2.5, 5.0, 10.0)
LEAST_TICKS = 2
"""Numbers on an axis from which its magnitude can be read."""


def write_powers(text: str) -> str:
    """The numbers of a text as they stand on paper: 1e-05 becomes 1×10⁻⁵, 3.22e+03 becomes 3220."""
    return re.sub(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]\d+)\b", lambda found: _write_power(found[1], int(found[2])), text)


def _write_power(mantissa: str, exponent: int) -> str:
    if 0 < exponent < PLAIN:
        return f"{float(mantissa) * 10**exponent:.0f}"
    return f"{mantissa}×10{str(exponent).translate(SUPERSCRIPTS)}"


@dataclass(frozen=True)
class Linear:
    """Equal steps; `low` and `high` left open follow the data with a little room."""

    low: float | None = None
    high: float | None = None

    def fitted(self, values: Array) -> "Linear":
        """The scale with its open ends set by the data."""
        low, high = float(values.min()), float(values.max())
        room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        return Linear(low - room if self.low is None else self.low, high + room if self.high is None else self.high)

    def place(self, values: Array) -> Array:
        """Values to [0, 1] between the ends."""
        low, high = self.ends
        return (np.asarray(values, dtype=float) - low) / (high - low)

    @property
    def ends(self) -> tuple[float, float]:
        """Both ends of a fitted scale."""
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Round numbers inside the scale, at most about `most` of them but two at the least, with their labels."""
        low, high = self.ends
        raw = (high - low) / max(most, 1)
        unit = 10.0 ** math.floor(math.log10(raw))
        steps = [size * factor for size in (unit, unit / 10) for factor in reversed(ROUND[:-1])]
        largest = next(factor * unit for factor in ROUND if factor * unit >= raw * (1 - 1e-9))
        for step in (largest, *(step for step in steps if step < largest * (1 - 1e-9))):
            marks = step * np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
            if len(marks) >= LEAST_TICKS:
                break
        labels = format_ticks(marks, step)
        return [(float(mark), label) for mark, label in zip(marks, labels, strict=True)]


@dataclass(frozen=True)
class Symlog:
    """Linear between -near and near, logarithmic beyond: decades of both signs in one axis."""

    near: float
    low: float | None = None
    high: float | None = None

    def fitted(self, values: Array) -> "Symlog":
        bent = self.bend(values)
        low, high = float(bent.min()), float(bent.max())
        room = 0.05 * (high - low) or 0.5
        return Symlog(self.near, *(self.unbend(end) for end in (low - room, high + room)))

    def bend(self, values: Array) -> Array:
        """sign(v) (1 + log10(|v|/near)) beyond near, v/near inside."""
        scaled = np.asarray(values, dtype=float) / self.near
        size = np.abs(scaled)
        return np.where(size <= 1, scaled, np.sign(scaled) * (1 + np.log10(np.maximum(size, 1))))

    def unbend(self, bent: float) -> float:
        """The inverse of `bend`."""
        return self.near * (bent if abs(bent) <= 1 else math.copysign(10.0 ** (abs(bent) - 1), bent))

    def place(self, values: Array) -> Array:
        assert self.low is not None
        assert self.high is not None
        low, high = self.bend(np.array([self.low, self.high]))
        return (self.bend(values) - low) / (high - low)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        low, high = (float(v) for v in self.bend(np.array([self.low, self.high])))
        start = round(math.log10(self.near))
        every = max(1, math.ceil((max(high, 0) - min(low, 0)) / max(most, 1)))
        powers = range(0, math.ceil(max(abs(low), abs(high))) + 1, every)
        marks = [(0.0, "0")]
        for sign, mark in ((1, ""), (-1, "−")):
            marks += [(sign * 10.0 ** (start + k), f"{mark}{format_power_of_ten(start + k)}") for k in powers]
        inside = [(value, label) for value, label in marks if low <= float(self.bend(np.array(value))) <= high]
        return inside if len(inside) >= LEAST_TICKS else Linear(self.low, self.high).ticks(most)


@dataclass(frozen=True)
class Logarithmic:
    """Equal steps are equal factors; values must be positive."""

    low: float | None = None
    high: float | None = None

    def fitted(self, values: Array) -> "Logarithmic":
        positive = values[values > 0]
        low, high = (float(positive.min()), float(positive.max())) if positive.size else (1.0, 10.0)
        room = max((high / low) ** 0.06, 1.15)
        return Logarithmic(
            low / room if self.low is None else self.low, high * room if self.high is None else self.high
        )

    def place(self, values: Array) -> Array:
        assert self.low is not None
        assert self.high is not None
        low, high = math.log10(self.low), math.log10(self.high)
        with np.errstate(divide="ignore"):
            return (np.log10(np.maximum(np.asarray(values, dtype=float), 0)) - low) / (high - low)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        assert self.low is not None
        assert self.high is not None
        first, last = math.ceil(math.log10(self.low) - 1e-9), math.floor(math.log10(self.high) + 1e-9)
        if last - first < 1:
            return Linear(self.low, self.high).ticks(most)
        if 3 * (last - first + 1) <= most:
            marks = [(factor, k) for k in range(first - 1, last + 1) for factor in (1, 2, 5)]
            inside = [(f, k) for f, k in marks if self.low <= f * 10.0**k * (1 + 1e-9) and f * 10.0**k <= self.high]
            return [(f * 10.0**k, format_ticks(np.array([f * 10.0**k]), 10.0**k)[0]) for f, k in inside]
        every = max(1, math.ceil((last - first + 1) / max(most, 1)))
        return [(10.0**k, format_power_of_ten(k)) for k in range(first, last + 1, every)]


@dataclass(frozen=True)
class Named:
    """Names at 0, 1, 2 ..., each as wide as the others."""

    names: tuple[str, ...]

    def fitted(self, values: Array) -> "Named":
        """Names need no data."""
        return self

    def place(self, values: Array) -> Array:
        """The middle of each name's share of [0, 1]."""
        return (np.asarray(values, dtype=float) + 0.5) / len(self.names)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Every name."""
        return [(float(i), name) for i, name in enumerate(self.names)]


Scale = Linear | Symlog | Logarithmic | Named


def format_ticks(marks: Array, step: float) -> list[str]:
    """Labels with as many decimals as the step needs; very large or small ones as multiples of a power of ten."""
    largest = float(np.abs(marks).max(initial=0.0))
    if largest < 1e6 and step >= 1e-4:
        decimals = next((d for d in range(8) if abs(round(step, d) - step) < 1e-9 * step), 8)
        return [f"{mark:.{decimals}f}".replace("-", "−") if mark != 0 else "0" for mark in marks]
    power = math.floor(math.log10(largest))
    scaled, size = marks / 10.0**power, step / 10.0**power
    decimals = next((d for d in range(16) if abs(round(size, d) - size) < 1e-6 * size), 16)
    behind = f"×10{str(power).translate(SUPERSCRIPTS)}"
    return [f"{mark:.{decimals}f}".replace("-", "−") + behind if mark != 0 else "0" for mark in scaled]


def format_power_of_ten(k: int) -> str:
    """0.01, 0.1, 1, 10, 100, else 10 with a superscript."""
    return f"{10.0**k:g}" if -2 <= k <= 2 else "10" + str(k).translate(SUPERSCRIPTS)
