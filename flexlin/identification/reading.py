"""A log from a file, or from what other libraries hold: columns by name, chosen by the scene's [log] table."""

import csv
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.arguments import checked
from flexlin.bounds import LARGEST_LOG, MOST_COLUMNS, hint_at, printable, refuse_odd
from flexlin.checks import Array
from flexlin.errors import ArgumentError, FlexlinError, TooLarge
from flexlin.identification.log import FEWEST_SAMPLES, MOST_SAMPLES, Log, as_numbers
from flexlin.scene.scene import Scene


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
    columns |= {name: one.column for name, one in table.outputs.items()}
    source = printable(path) if isinstance(path, (str, Path)) else ""
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
            raise ArgumentError("this is no log", got=printable(repr(source))[:80], expected=expected)
        return pick_columns(source, wanted)
    path = Path(source)
    try:
        refuse_odd(path.stat(), LARGEST_LOG)
        with open_table(path, wanted) as table:
            return pick_columns(table, wanted)
    except FlexlinError:
        raise
    except Exception as error:  # whatever the reader of a damaged file meets
        expected = "a CSV file in UTF-8 with a head line, .npz, or .nc"
        raise ArgumentError(
            f"the log {printable(path)} cannot be read", got=printable(error)[:120], expected=expected
        ) from None


def pick_columns(data: Any, wanted: list[str]) -> dict[str, Array]:
    """The wanted columns of a table, as numbers; nothing else of it is loaded."""
    names = [str(name) for name in (getattr(data, "variables", None) or data)]
    missing = [name for name in wanted if name not in names]
    if missing:
        some = ", ".join(names[:12]) + (" ..." if len(names) > 12 else "")
        todo = f"correct the scene's [log] table{hint_at(missing[0], names)}"
        raise ArgumentError("the log lacks columns", got=printable(some), expected=", ".join(missing), todo=todo)
    columns = {name: data[name] for name in wanted}
    rows = max(int(np.prod(np.shape(column), dtype=float)) for column in columns.values())
    if rows > MOST_SAMPLES:
        todo = "take a part of it, or every tenth row after a low-pass filter"
        raise TooLarge(
            "the log has too many rows", got=f"more than {MOST_SAMPLES}", expected=f"{MOST_SAMPLES} at most", todo=todo
        )
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
        if head.count(",") > MOST_COLUMNS:  # pandas takes time by the square of names that are alike
            raise ValueError(f"it has {head.count(',')} columns, more than {MOST_COLUMNS}")
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
