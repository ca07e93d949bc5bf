"""Quantities with units: "2 mm" or 0.002, "3 N m", "5 deg/s", each held to the dimension that its key asks for."""

import re
from collections.abc import Sequence
from typing import Any

from flexlin.bounds import LARGEST_NUMBER, SMALLEST_NUMBER, read_number
from flexlin.errors import ArgumentError

Dimension = tuple[int, ...]
"""Powers of m, kg, s, A, rad and B; an angle counts as a dimension, so that no degree passes for a metre."""

_BASE = ("m", "kg", "s", "A", "rad", "B")
_WITH_PREFIXES = """
    m 1 m; g 0.001 kg; s 1 s; A 1 A; rad 1 rad; N 1 kg m/s^2; Nm 1 N m; J 1 N m; W 1 J/s; V 1 W/A; ohm 1 V/A; Hz 1 1/s; Pa 1 N/m^2
"""
_PREFIXES = "k 1e3; m 1e-3; u 1e-6; µ 1e-6; μ 1e-6; n 1e-9"
_ALONE = """
    cm 1e-2 m; MPa 1e6 Pa; GPa 1e9 Pa; rev 6.283185307179586 rad; deg 0.017453292519943295 rad; ° 1 deg; min 60 s; rpm 1 rev/min;
    kB 1e3 B; MB 1e6 B; GB 1e9 B
"""
UNITS: dict[str, tuple[float, Dimension]] = {}
"""Every unit that may be written, with its size in SI units."""
NAMES = {
    "m": "a length such as 2 mm",
    "kg": "a mass such as 100 g",
    "kg/m": "a mass per length such as 162 g/m",
    "rad": "an angle such as 0.5 deg",
    "m/s": "a speed such as 50 mm/s",
    "rad/s": "a rate such as 5 deg/s",
    "N m": "a torque such as 3 N m",
    "N": "a force such as 3 N",
    "V": "a voltage such as 6 V",
    "A": "a current such as 2 A",
    "ohm": "a resistance such as 1.2 ohm",
    "s": "a time such as 2 ms",
    "Hz": "a frequency such as 30 Hz",
    "W": "a power such as 20 W",
    "1/m": "a curvature such as 0.01 1/m",
    "N m/A": "a torque constant such as 0.05 N m/A",
    "N/A": "a force constant such as 20 N/A",
    "rad s": "an integral of an angle such as 0.2 deg s",
    "m s": "an integral of a length such as 1 mm s",
    "Pa": "an elastic modulus such as 70 GPa",
    "kg/m^3": "a density such as 2.7 g/cm^3",
    "B": "a memory such as 500 MB",
}
"""The dimensions that keys ask for by their SI unit, in words."""
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


def dimension_of(unit: str) -> tuple[float, Dimension]:
    """Return the size in SI units and the dimension of a unit such as "mN m" or "deg/s^2"; raises ValueError naming what is no unit."""
    size, powers = 1.0, [0] * len(_BASE)
    for place, side in enumerate(unit.split("/")):
        for factor in re.split(r"[\s*·]+", re.sub(r"^\((.+)\)$", r"\1", side.strip())):
            name, _, power = factor.replace("²", "^2").partition("^")
            if name in ("1", "") and place == 0:
                continue
            if name not in UNITS or not re.fullmatch(r"[1-9]?", power):
                raise ValueError(f"a known unit in the place of {factor!r}")
            times = int(power or 1) * (-1 if place else 1)
            size *= UNITS[name][0] ** times
            powers = [p + times * q for p, q in zip(powers, UNITS[name][1], strict=True)]
    return size, tuple(powers)


def define_units() -> None:
    """Fill the table of units, each by those before it: its name, its size, and what it is a multiple of."""
    for name in _BASE:
        UNITS[name] = (1.0, tuple(int(name == base) for base in _BASE))
    prefixes = [prefix.split() for prefix in _PREFIXES.split(";")]
    for table, before in ((_WITH_PREFIXES, prefixes), (_ALONE, [])):
        for line in table.split(";"):
            name, size, unit = line.split(maxsplit=2)
            whole, powers = dimension_of(unit)
            UNITS[name] = (float(size) * whole, powers)
            UNITS.update({prefix + name: (float(times) * UNITS[name][0], powers) for prefix, times in before})


define_units()


def read_quantity(value: Any) -> tuple[float, Dimension | None]:
    """Read a number, or a text such as "2 mm", in SI units; its dimension is None where no unit was written.

    Raises: ValueError with what was expected.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError("a number, or a text such as '2 mm'")
    if not isinstance(value, str):
        return float(value), None
    found = _NUMBER.fullmatch(value)
    if found is None:
        raise ValueError("a number with a unit, such as '2 mm'")
    number, unit = read_number(found.group(1)), found.group(2)
    if not unit:
        return number, None
    size, powers = dimension_of(unit)
    return number * size, powers


def in_si(value: Any, *units: str) -> float:
    """Return a quantity in SI units; it must have the dimension of one of these units. Raises: ValueError with what was expected."""
    wanted = " or ".join(f"{NAMES[unit]} (a bare number is in {unit})" for unit in units)
    try:
        number, dimension = read_quantity(value)
    except ValueError as error:
        raise ValueError(f"{error}: {wanted}") from None
    if dimension not in (None, *(dimension_of(unit)[1] for unit in units)):
        raise ValueError(wanted)
    return number


def split_units(units: str) -> list[str]:
    """The units of a key whose things are of several kinds, such as rad or m."""
    return re.split(r" or |, ", units)


def in_unit(value: Any, unit: str, sliding: bool | None = False) -> Any:
    """A text such as "1000 mm", or each of a list of such, in a key's SI unit; what does not fit as it is, for the schema to refuse.

    unit: as keys state it; of "rad or m" the first is meant for joints that turn, the second for those that slide.
    sliding: whether the joints slide; None where some do and others do not.
    """
    if isinstance(value, (list, tuple)):
        return [in_unit(item, unit, sliding) for item in value]
    if not isinstance(value, str):
        return value
    turns, *slides = split_units(unit)
    try:
        number, dimension = read_quantity(value)
        size, wanted = dimension_of(slides[0] if slides and sliding else turns)
    except ValueError:
        return value
    fits = dimension == wanted and not (slides and sliding is None)
    return number / size if fits else value


def keep_quantity(value: Any, units: Sequence[str]) -> Any:
    """A quantity as it was written, once it has been found positive and of one of the dimensions; or a list of such."""
    if isinstance(value, (list, tuple)):
        if not value:
            raise ValueError("a list of 1 or more")
        return tuple(keep_quantity(item, units) for item in value)
    if not SMALLEST_NUMBER <= in_si(value, *units) <= LARGEST_NUMBER:
        raise ValueError("a number greater than 0")
    return value


def spread(key: str, value: Any, units: Sequence[str]) -> list[float] | None:
    """Return a quantity, or a list of one each, in the SI units of several things; raises ArgumentError where it does not fit."""
    if value is None:
        return None
    several = list(value) if isinstance(value, (list, tuple)) else [value] * len(units)
    if len(several) != len(units):
        raise ArgumentError(f"{key} does not fit the arm", got=f"{len(several)} quantities", expected=f"{len(units)}")
    try:
        return [in_si(item, unit) for item, unit in zip(several, units, strict=True)]
    except ValueError as error:
        raise ArgumentError(f"{key} has another unit than the arm", got=repr(value), expected=str(error)) from None
