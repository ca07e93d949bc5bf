"""What a machine was given and what its sensors read, by time."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from flexlin.bounds import IN_RANGE, LARGEST_NUMBER, SMALLEST_NUMBER, printable
from flexlin.checks import Array, real_array, whole
from flexlin.errors import ArgumentError, TooLarge, counted
from flexlin.plots.view import Series, Shown, View
from flexlin.precision import ROOT_EPS
from flexlin.summary import represent

if TYPE_CHECKING:
    import xarray

MOST_SAMPLES = 2_000_000
"""Samples of one log."""
FEWEST_SAMPLES = 20
"""Samples of a stretch without a gap: fewer say nothing about an arm that moves."""
SLOWEST_STEP = 0.05
"""Usual time between rows in s from which on they are more likely milliseconds, or numbers of rows: no arm's vibration is sampled so."""
GAP_INTERVALS = 5.0
"""A gap is a time between rows of more than so many usual ones; over shorter ones inputs are interpolated."""


@dataclass(frozen=True, eq=False)
class Log(Shown):
    """A measured log: inputs and sensors as they were recorded.

    What a reading means (gain, offset, delay, kind of sensor) says the scene's [log] table; without one an input's name is that of a
    joint, and an output's that of a coordinate (q1), its rate (q1_rate), or the tip's place (tip.x). A reading that is not a number is
    missing. Times may jitter; over a gap in them, or where an input is missing, no prediction goes.

    Attributes
    ----------
    time : array, shape (N,)
        Increasing times in s.
    inputs, outputs : mapping of str to array, shape (N,)
        Readings by name.
    columns : mapping of str to str
        Names of the columns that they came from, where these are others.
    source : str
        Where it was read from.

    Raises
    ------
    ArgumentError
        When lengths differ, times do not increase, or there are too few samples.
    TooLarge
        When there are more than two million samples.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> t = np.arange(100) * 0.01
    >>> log = fl.Log(t, inputs={"q1": np.sin(t)}, outputs={"tip.y": np.cos(t)})
    >>> print(log.summary())
    log of 0.99 s, 100 samples at 100 Hz
      inputs q1; outputs tip.y
    """

    time: Array
    inputs: Mapping[str, Array]
    outputs: Mapping[str, Array]
    columns: Mapping[str, str] = field(default_factory=dict)
    source: str = ""

    __repr__ = represent

    def __post_init__(self) -> None:
        time = check_times(self.time)
        groups = {
            kind: {name: check_readings(name, values, len(time)) for name, values in getattr(self, kind).items()}
            for kind in ("inputs", "outputs")
        }
        if not groups["outputs"] or not groups["inputs"]:
            missing = "inputs" if groups["outputs"] else "outputs"
            raise ArgumentError(f"the log has no {missing}", expected="one of each at the least")
        for name, value in ({"time": time} | groups).items():
            object.__setattr__(self, name, value)

    @property
    def step(self) -> float:
        """The usual time between two rows, in s."""
        return float(np.median(np.diff(self.time)))

    @property
    def stretches(self) -> list[slice]:
        """The rows between gaps, where there are enough of them."""
        known = np.all([np.isfinite(values) for values in self.inputs.values()], axis=0)
        near = np.diff(self.time) <= GAP_INTERVALS * self.step
        ends = np.flatnonzero(~(near & known[1:] & known[:-1])) + 1
        edges = [0, *ends.tolist(), len(self.time)]
        return [slice(a, b) for a, b in itertools.pairwise(edges) if b - a >= FEWEST_SAMPLES]

    @property
    def advice_on_times(self) -> str | None:
        """What to do where rows come so seldom that times are hardly seconds."""
        todo = "if times are in ms or count rows, say second = 0.001, or what it is, in the scene's [log] table"
        return todo if self.step >= SLOWEST_STEP else None

    @property
    def notes(self) -> tuple[str, ...]:
        """What is missing or odd in it, in words."""
        said, spacing = [], np.diff(self.time)
        if self.advice_on_times:
            said.append(f"rows come each {self.step:.3g} s: {self.advice_on_times}")
        gaps = np.flatnonzero(spacing > GAP_INTERVALS * self.step)
        if len(gaps):
            longest = gaps[np.argmax(spacing[gaps])]
            where = f"the longest of {spacing[longest]:.3g} s at {self.time[longest]:.4g} s"
            said.append(f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''}, {where}: no prediction goes over one")
        jitter = float(np.abs(spacing[spacing <= GAP_INTERVALS * self.step] - self.step).max(initial=0.0))
        if jitter > 0.05 * self.step:
            said.append(f"times jitter by up to {1e3 * jitter:.3g} ms: readings are taken at their own times")
        inputs = {f"the input {name}" if name in self.outputs else name: values for name, values in self.inputs.items()}
        for name, values in {**inputs, **self.outputs}.items():
            missing = int(np.isnan(values).sum())
            if missing:
                said.append(f"{missing} readings of {name} are missing and are not used")
            if not varies(values):
                said.append(f"{name} is constant, so nothing can be learnt from it")
        return tuple(said)

    def part(self, start: float, end: float) -> "Log":
        """Return the rows from one time to another.

        Parameters
        ----------
        start, end : float
            Times in s.

        Returns
        -------
        Log
            Those rows.

        Examples
        --------
        >>> import numpy as np
        >>> import flexlin as fl
        >>> t = np.arange(100) * 0.01
        >>> len(fl.Log(t, {"q1": t}, {"q1": t}).part(0.2, 0.6).time)
        41
        """
        return self._taken(np.flatnonzero((self.time >= start - 1e-9) & (self.time <= end + 1e-9)))

    def thinned(self, by: int) -> "Log":
        """Return every so-manieth row, without a filter: what moves faster than half the new rate folds down.

        Parameters
        ----------
        by : int
            Rows for each one that is kept.

        Returns
        -------
        Log
            Those rows.

        Examples
        --------
        >>> import numpy as np
        >>> import flexlin as fl
        >>> t = np.arange(100) * 0.01
        >>> round(fl.Log(t, {"q1": t}, {"q1": t}).thinned(4).step, 6)
        0.04
        """
        return self._taken(np.arange(0, len(self.time), whole("by", by)))

    def _taken(self, rows: Array) -> "Log":
        """The rows of these numbers."""
        inputs, outputs = ({k: v[rows] for k, v in group.items()} for group in (self.inputs, self.outputs))
        return replace(self, time=self.time[rows], inputs=inputs, outputs=outputs)

    def to_xarray(self) -> "xarray.Dataset":
        """Return the readings as a dataset.

        Returns
        -------
        xarray.Dataset
            Inputs and outputs by time, each marked by its role; an input that shares a name with an output ends in _input.
        """
        import xarray

        named = {f"{k}_input" if k in self.outputs else k: v for k, v in self.inputs.items()}
        groups = {"input": named, "output": self.outputs}
        series = {
            name: ("time", values, {"role": role}) for role, group in groups.items() for name, values in group.items()
        }
        return xarray.Dataset(series, coords={"time": ("time", self.time, {"units": "s"})})

    def _view(self) -> View:
        length, rate = self.time[-1] - self.time[0], 1 / self.step
        title = f"log of {length:.4g} s, {len(self.time)} samples at {rate:.4g} Hz"
        names = f"inputs {', '.join(self.inputs)}; outputs {', '.join(self.outputs)}"
        series = tuple(Series(name, self.time, values) for name, values in self.outputs.items())
        return View(title, "", (names, *self.notes), "time in s", "reading", series)


def check_times(given: Array) -> Array:
    """Times that increase, enough and not too many of them."""
    time = real_array("time", given, (None,))
    if len(time) > MOST_SAMPLES:
        todo = "give a part of it, or thin it: every tenth row, after a low-pass filter"
        raise TooLarge("the log has too many samples", got=len(time), expected=f"{MOST_SAMPLES} at most", todo=todo)
    if len(time) < FEWEST_SAMPLES:
        raise ArgumentError(
            "the log is too short", got=counted(len(time), "sample"), expected=f"{FEWEST_SAMPLES} at the least"
        )
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        row = int(late[0])
        raise ArgumentError(
            "the times of the log do not increase",
            got=f"{time[row]:.9g} s before {time[row + 1]:.9g} s in rows {row + 1} and {row + 2}",
            todo="remove rows that are there twice, and sort the others",
        )
    return time


def check_readings(name: str, given: Array, count: int) -> Array:
    """Readings, some of which may be missing."""
    values = np.asarray(given) if hasattr(given, "dtype") else np.array(given, dtype=object)
    if values.shape != (count,):
        raise ArgumentError(f"{name} has the wrong shape", got=values.shape, expected=f"({count},), a reading a time")
    numbers = as_numbers(name, values)
    if not np.isfinite(numbers).any():
        raise ArgumentError(f"{name} has no reading", got="nan everywhere", expected="numbers")
    return numbers


def as_numbers(name: str, values: Array) -> Array:
    """A column as numbers; an empty cell, or one that says so, is a missing reading."""
    values = values.astype(str) if np.iscomplexobj(values) else values  # none of which is a number then
    if values.dtype.kind in "iuf":
        numbers = values.astype(float)
        odd = np.flatnonzero(np.abs(numbers) > LARGEST_NUMBER)
    else:
        import pandas

        numbers = np.asarray(pandas.to_numeric(values, errors="coerce"), dtype=float)
        odd = np.flatnonzero(~(np.abs(numbers) <= LARGEST_NUMBER) & ~pandas.isna(values))
    if len(odd):
        row = int(odd[0])
        raise ArgumentError(
            f"column {name} is not numeric",
            got=f"{printable(repr(str(values[row])))} in row {row + 1}",
            expected=f"empty cells, or {IN_RANGE}",
        )
    return numbers


def varies(values: Array) -> bool:
    """Whether readings, of which some are known, differ by more than rounding."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return high - low > max(SMALLEST_NUMBER, ROOT_EPS * max(abs(low), abs(high)))
