"""Disturbances in words: "joint 1 torque 0.1 N m", "w11=1 cm", "tip 1 N 20 ms", "torque 0.05 N m 100 Hz"."""

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.export.labels import Labels
from flexlin.errors import ArgumentError
from flexlin.scene.base import LARGEST, SMALLEST
from flexlin.scene.units import in_si

Kind = Literal["step", "initial", "push", "noise"]
PATTERNS = {
    "step": re.compile(r"joint\s+(?P<joint>\d+)\s+torque\s+(?P<size>\S.*)"),
    "push": re.compile(r"tip(\s+(?P<axis>[xyz]))?\s+(?P<size>[-+.\deE]+\s*[mkµu]?N)\s+(?P<time>[-+.\deE]+\s*[mu]?s)"),
    "noise": re.compile(r"torque\s+(?P<size>[-+.\deE]+\s*[a-zA-Z ]+?)\s+(?P<time>[-+.\deE]+\s*k?Hz)"),
}
EXAMPLES = {
    "step": "joint 1 torque 0.1 N m",
    "initial": "w11=1 cm, q1_rate=5 deg/s",
    "push": "tip 1 N 20 ms (across the last link), or tip x 1 N 20 ms",
    "noise": "torque 0.05 N m 100 Hz (root mean square and bandwidth)",
}


@dataclass(frozen=True)
class Disturbance:
    """A disturbance of one of four kinds.

    step: a torque `size` at input `joint` from a phase on; initial: a state `start` (2n,) beside the steady motion;
    push: a force `size` in N at the tip for `time` s, along a world axis or across the last link (axis empty);
    noise: white torques of root mean square `size` within a bandwidth `time` in Hz.
    """

    kind: Kind
    words: str
    size: float = 0.0
    joint: int = 0
    axis: str = ""
    time: float = 0.0
    start: tuple[float, ...] = ()


def state_disturbance(kind: Kind, words: str, lin: Linearization) -> Disturbance:
    """Read a disturbance of a linearization's arm; raises ArgumentError with what was expected."""
    try:
        if kind == "initial":
            return Disturbance(kind, words, start=tuple(read_state(words, lin).tolist()))
        found = PATTERNS[kind].fullmatch(words.strip())
        if found is None:
            raise ValueError(EXAMPLES[kind])
        parts = found.groupdict()
        if kind == "step":
            joint = int(parts["joint"])
            if not 1 <= joint <= lin.about.m:
                raise ValueError(f"a joint from 1 to {lin.about.m}")
            return Disturbance(kind, words, sane_size(parts["size"], lin.input_units[joint - 1]), joint - 1)
        if kind == "push":
            size, time = sane_size(parts["size"], "N"), positive_time(parts["time"], "s")
            return Disturbance(kind, words, size, 0, parts["axis"] or "", time)
        unit = lin.input_units[0] if lin.input_units else "N m"
        return Disturbance(kind, words, sane_size(parts["size"], unit), time=positive_time(parts["time"], "Hz"))
    except ValueError as error:
        raise ArgumentError(f"--{kind} cannot be read", got=repr(words), expected=str(error)) from None


def sane_size(text: str, unit: str, zero: bool = False) -> float:
    """A quantity as a number that other numbers of an arm can be compared with; raises ValueError."""
    value = in_si(text, unit)
    if not (SMALLEST <= abs(value) <= LARGEST or (zero and not value)):
        raise ValueError(f"a number from {SMALLEST:g} to {LARGEST:g} in the place of {text!r}")
    return value


def positive_time(text: str, unit: str) -> float:
    """A time or a frequency greater than 0; raises ValueError."""
    value = sane_size(text, unit)
    if not value > 0:
        raise ValueError(f"a number greater than 0 in the place of {text!r}")
    return value


def read_state(words: str, lin: Linearization) -> Array:
    """A state [y; y'] (2n,) from "name=quantity" pairs."""
    labels, start = Labels.of(lin), np.zeros(2 * lin.n)
    units = dict(zip(labels.states[: len(start)], labels.state_units, strict=False))
    for pair in filter(None, (part.strip() for part in words.split(","))):
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals or name not in units:
            raise ValueError(f"pairs such as {EXAMPLES['initial']}, of {', '.join(units)}")
        start[labels.states.index(name)] = sane_size(value, units[name], zero=True)
    if not start.any():
        raise ValueError(EXAMPLES["initial"])
    return start
