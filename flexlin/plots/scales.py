"""Scales of axes: from values to the unit interval, with ticks at round numbers."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def write_powers(text: str) -> str:
    """The numbers of a text as they stand on paper: 1e-05 becomes 1×10⁻⁵, 3.22e+03 becomes 3220."""

    def write(found: re.Match[str]) -> str:
        mantissa, exponent = found[1], int(found[2])
        plain = f"{float(mantissa) * 10**exponent:.0f}"
        return plain if 0 < exponent < 5 else f"{mantissa}×10{str(exponent).translate(SUPERSCRIPTS)}"

    return re.sub(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]\d+)\b", write, text)


@dataclass(frozen=True)
class Linear:
    """Equal steps; `low` and `high` left open follow the data with a little room, on the bent axis of other scales too."""

    low: float | None = None
    high: float | None = None

    def bend(self, values: ArrayLike) -> Array:
        """Values as lengths along the axis."""
        return np.asarray(values, dtype=float)

    def unbend(self, length: float) -> float:
        """The value at a length along the axis."""
        return length

    def find_room(self, low: float, high: float) -> float:
        """How far the axis goes on beyond the data, which end at these lengths."""
        return 0.05 * (high - low) or 0.05 * abs(high) or 1.0

    def fitted(self, values: Array) -> Self:
        """The scale with its open ends set by the data."""
        bent = self.bend(values)
        known = bent[np.isfinite(bent)] if np.isfinite(bent).any() else np.array([0.0, 1.0])
        low, high = float(known.min()), float(known.max())
        room = self.find_room(low, high)
        open_ends = self.unbend(low - room), self.unbend(high + room)
        low, high = (end if own is None else own for own, end in zip((self.low, self.high), open_ends, strict=True))
        return replace(self, low=low, high=high)

    def place(self, values: ArrayLike) -> Array:
        """Values to [0, 1] between the ends."""
        low, high = self.bend(np.array(self.ends))
        return np.asarray((self.bend(values) - low) / (high - low))

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
        steps = [10 * unit, *(size * factor for size in (unit, unit / 10) for factor in (5.0, 2.5, 2.0, 1.0))]
        largest = min(step for step in steps if step >= raw * (1 - 1e-9))
        for step in (step for step in steps if step <= largest):
            marks = step * np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
            if len(marks) >= 2:  # from one alone no magnitude can be read
                break
        labels = format_ticks(marks, step)
        return [(float(mark), label) for mark, label in zip(marks, labels, strict=True)]


@dataclass(frozen=True)
class Symlog(Linear):
    """Linear between -near and near, logarithmic beyond: decades of both signs in one axis."""

    near: float = field(default=1.0, kw_only=True)

    def bend(self, values: ArrayLike) -> Array:
        """sign(v) (1 + log10(|v|/near)) beyond near, v/near inside."""
        scaled = np.asarray(values, dtype=float) / self.near
        size = np.abs(scaled)
        return np.where(size <= 1, scaled, np.sign(scaled) * (1 + np.log10(np.maximum(size, 1))))

    def unbend(self, length: float) -> float:
        inside = abs(length) <= 1
        return self.near * (length if inside else math.copysign(10 ** (abs(length) - 1), length))

    def find_room(self, low: float, high: float) -> float:
        return 0.05 * (high - low) or 0.5

    def ticks(self, most: int) -> list[tuple[float, str]]:
        low, high = self.bend(np.array(self.ends)).tolist()
        start = round(math.log10(self.near))
        every = max(1, math.ceil((max(high, 0) - min(low, 0)) / max(most, 1)))
        powers = range(start, start + math.ceil(max(abs(low), abs(high))) + 1, every)
        marks = [(sign, k) for sign in (1, -1) for k in powers if low <= float(self.bend(sign * 10.0**k)) <= high]
        zero = [(0.0, "0")] if low <= 0 <= high else []
        labels = format_powers_of_ten([k for _, k in marks])
        inside = [(s * 10.0**k, "−" * (s < 0) + label) for (s, k), label in zip(marks, labels, strict=True)]
        return zero + inside if len(zero + inside) >= 2 else Linear(*self.ends).ticks(most)


@dataclass(frozen=True)
class Logarithmic(Linear):
    """Equal steps are equal factors; values must be positive."""

    def bend(self, values: ArrayLike) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log10(np.maximum(np.asarray(values, dtype=float), 0)))

    def unbend(self, length: float) -> float:
        return float(10.0**length)

    def find_room(self, low: float, high: float) -> float:
        return 0.06 * max(high - low, 1.0)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        low, high = self.ends
        first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
        if last - first < 1:
            return Linear(low, high).ticks(most)
        if 3 * (last - first + 1) <= most:
            marks = [(factor, k) for k in range(first - 1, last + 1) for factor in (1, 2, 5)]
            inside = [(f, k) for f, k in marks if low <= f * 10.0**k * (1 + 1e-9) and f * 10.0**k <= high]
            plain = 9e-5 < low < high < 1e6
            return [
                (f * 10.0**k, f"{f * 10.0**k:g}" if plain else f"{f}×10{str(k).translate(SUPERSCRIPTS)}")
                for f, k in inside
            ]
        every = max(1, math.ceil((last - first + 1) / max(most, 1)))
        powers = range(first, last + 1, every)
        return [(10.0**k, label) for k, label in zip(powers, format_powers_of_ten(powers), strict=True)]


@dataclass(frozen=True)
class Named(Linear):
    """Names at 0, 1, 2 ..., each as wide as the others."""

    names: tuple[str, ...] = ()

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Every name."""
        return [(float(i), name) for i, name in enumerate(self.names)]


def format_ticks(marks: Array, step: float) -> list[str]:
    """Labels with as many decimals as the step needs; very large or small ones as multiples of a power of ten."""
    largest = float(np.abs(marks).max(initial=0.0))
    power = 0 if largest < 1e6 and step >= 1e-4 else math.floor(math.log10(largest))
    scaled, size = marks / 10.0**power, step / 10.0**power
    decimals = next((d for d in range(16) if abs(round(size, d) - size) < 1e-9 * size), 16)
    behind = f"×10{str(power).translate(SUPERSCRIPTS)}" if power else ""
    return [f"{mark:.{decimals}f}".replace("-", "−") + behind if mark != 0 else "0" for mark in scaled]


def format_powers_of_ten(powers: Sequence[int]) -> list[str]:
    """0.01, 0.1, 1, 10, 100; where one lies beyond these, all as 10 with a superscript."""
    plain = all(-2 <= k <= 2 for k in powers)
    return [f"{10.0**k:g}" if plain else f"10{str(k).translate(SUPERSCRIPTS)}" for k in powers]
