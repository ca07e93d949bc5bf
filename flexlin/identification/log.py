"""What a machine was given and what its sensors read, by time: from arrays, from a file, or from what other libraries hold."""

import csv
import itertools
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin import bounds
from flexlin.arguments import checked
from flexlin.checks import Array, real_array, whole
from flexlin.errors import ArgumentError, FlexlinError, TooLarge, counted
from flexlin.plots.view import Series, Shown, View
from flexlin.precision import ROOT_EPS
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

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


@immutable(eq=False)
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
            todo = "no prediction goes over one, so log that part again if it matters"
            said.append(f"{counted(len(gaps), 'gap')}, {where}: {todo}")
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
        odd = np.flatnonzero(np.abs(numbers) > bounds.LARGEST_NUMBER)
    else:
        import pandas

        numbers = np.asarray(pandas.to_numeric(values, errors="coerce"), dtype=float)
        odd = np.flatnonzero(~(np.abs(numbers) <= bounds.LARGEST_NUMBER) & ~pandas.isna(values))
    if len(odd):
        row = int(odd[0])
        raise ArgumentError(
            f"column {name} is not numeric",
            got=f"{bounds.printable(repr(str(values[row])))} in row {row + 1}",
            expected=f"empty cells, or {bounds.IN_RANGE}",
        )
    return numbers


def varies(values: Array) -> bool:
    """Whether readings, of which some are known, differ by more than rounding."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return high - low > max(bounds.SMALLEST_NUMBER, ROOT_EPS * max(abs(low), abs(high)))


@checked
def read_log(path: Any, scene: Scene) -> Log:
    """Read a measured log by the columns that the scene's [log] table names.

    Parameters
    ----------
    path : str, Path, mapping, pandas.DataFrame or xarray.Dataset
        A CSV file with a head line, NumPy's .npz, netCDF (.nc), or columns by name.
    scene : Scene
        With a [log] table.

    Returns
    -------
    Log
        The readings as they stand there; what they mean stays in the scene. Of a strain gauge that first repeats one value, as while
        its bias is taken, these readings are missing.

    Raises
    ------
    ArgumentError
        When the file, the table or a column is missing, or a cell is no number.
    TooLarge
        When there are more than two million rows.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> columns = {"t": np.arange(50) * 0.01, "torque_Nm": np.ones(50), "angle_rad": np.zeros(50)}
    >>> table = {"inputs": {"q1": {"column": "torque_Nm"}}, "outputs": {"q1": {"column": "angle_rad"}}}
    >>> fl.read_log(columns, fl.load_scene("single-link", {"log": table})).inputs["q1"][:2].tolist()
    [1.0, 1.0]
    """
    table = scene.log
    if table is None or not table.inputs or not table.outputs:
        todo = "name time, inputs and outputs in the scene's [log] table, or make a flexlin.Log"
        raise ArgumentError("the scene does not say what the columns of a log are", got="no [log] table", todo=todo)
    wanted = [table.time, *(one.column for group in (table.inputs, table.outputs) for one in group.values())]
    found = take_columns(path, list(dict.fromkeys(wanted)))
    groups = {
        kind: {name: found[one.column] for name, one in getattr(table, kind).items()} for kind in ("inputs", "outputs")
    }
    for name, one in table.outputs.items():
        if one.sensor == "strain":
            groups["outputs"][name] = without_held(found[one.column])
    columns = {name: one.column for group in (table.inputs, table.outputs) for name, one in group.items()}
    source = bounds.printable(path) if isinstance(path, (str, Path)) else ""
    return Log(table.second * found[table.time], groups["inputs"], groups["outputs"], columns, source)


def without_held(values: Array) -> Array:
    """The readings, those that repeat the first value at the beginning missing, where there are many and others follow."""
    moved = np.flatnonzero(values != values[0]) if len(values) else values
    held = int(moved[0]) if len(moved) else 0
    return np.where(np.arange(len(values)) < held, np.nan, values) if held >= FEWEST_SAMPLES else values


def take_columns(source: Any, wanted: list[str]) -> dict[str, Array]:
    """The wanted columns of a file or of a table in memory, as numbers."""
    if not isinstance(source, (str, Path)):
        if not hasattr(source, "keys"):
            expected = "the name of a file, or columns by name"
            raise ArgumentError("this is no log", got=bounds.printable(repr(source))[:80], expected=expected)
        return pick_columns(source, wanted)
    path = Path(source)
    try:
        bounds.refuse_odd(path.stat(), bounds.LARGEST_LOG)
        with open_table(path, wanted) as table:
            return pick_columns(table, wanted)
    except FlexlinError:
        raise
    except Exception as error:  # whatever the reader of a damaged file meets
        expected = "a CSV file in UTF-8 with a head line and decimal points, .npz, or .nc"
        what, got = f"the log {bounds.printable(path)} cannot be read", bounds.printable(str(error).strip())[:120]
        got = bounds.NO_TEXT if isinstance(error, UnicodeDecodeError) else getattr(error, "strerror", None) or got
        raise ArgumentError(what, got=got, expected=expected) from None


def pick_columns(data: Any, wanted: list[str]) -> dict[str, Array]:
    """The wanted columns of a table, as numbers; nothing else of it is loaded."""
    names = [str(name) for name in (getattr(data, "variables", None) or data)]
    missing = [name for name in wanted if name not in names]
    if missing:
        some = ", ".join(names[:12]) + (" ..." if len(names) > 12 else "")
        todo = f"correct the scene's [log] table, or the file's head line{bounds.hint_at(missing[0], names)}"
        raise ArgumentError("the log lacks columns", got=bounds.printable(some), expected=", ".join(missing), todo=todo)
    columns = {name: data[name] for name in wanted}
    rows = max(int(np.prod(np.shape(column), dtype=float)) for column in columns.values())
    if rows > MOST_SAMPLES:
        todo = "take a part of it, or every tenth row after a low-pass filter"
        got, expected = f"more than {MOST_SAMPLES}", f"{MOST_SAMPLES} at most"
        raise TooLarge("the log has too many rows", got=got, expected=expected, todo=todo)
    return {name: as_numbers(name, np.asarray(column).reshape(-1)) for name, column in columns.items()}


@contextmanager
def open_table(path: Path, wanted: list[str]) -> Iterator[Any]:
    """The columns of a file by name; of those that are wanted there is one each."""
    if path.suffix == ".npz":
        with zipfile.ZipFile(path) as archive:
            yield {name.removesuffix(".npy"): ArrayOfFile(archive, name) for name in archive.namelist()}
    elif path.suffix in (".nc", ".h5"):
        import xarray

        with xarray.open_dataset(path) as data:
            yield data
    else:
        import pandas

        with path.open(encoding="utf-8-sig") as file:
            head = next((line for line in file if line.strip() and not line.startswith("#")), "")
        if head.count(",") > bounds.MOST_COLUMNS:  # pandas takes time by the square of names that are alike
            raise ValueError(f"it has {head.count(',')} columns, more than {bounds.MOST_COLUMNS}")
        names = next(csv.reader([head], skipinitialspace=True), [])
        if len(names) == 1 < len(wanted) and (";" in head or "\t" in head):
            raise ValueError("its columns are parted by semicolons or tabs, not by commas; numbers need points")
        if twice := [name for name in wanted if names.count(name) > 1]:
            raise ValueError(f"it has several columns named {', '.join(twice)}")
        with warnings.catch_warnings():
            warnings.simplefilter("error", pandas.errors.ParserWarning)  # rows that are longer than the head line
            usual = {"skipinitialspace": True, "comment": "#", "low_memory": False}
            yield pandas.read_csv(path, index_col=False, nrows=MOST_SAMPLES + 1, **usual)


class ArrayOfFile:
    """An array of an .npz file, unpacked once it is known to be no longer than it says; objects are refused."""

    def __init__(self, archive: zipfile.ZipFile, name: str):
        self._archive, self._name = archive, name
        with archive.open(name) as entry:
            version = np.lib.format.read_magic(entry)
            read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
            self.shape, _, dtype = read(entry)
        if dtype.hasobject or dtype.itemsize * np.prod(self.shape, dtype=float) > archive.getinfo(name).file_size:
            raise ValueError(f"{name} holds objects, or less than it says")

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        with self._archive.open(self._name) as entry:
            return np.asarray(np.lib.format.read_array(entry, allow_pickle=False), dtype=dtype)
