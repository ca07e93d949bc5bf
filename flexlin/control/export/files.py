"""A system and its designs over a period as one file: NumPy's npz, the same bytes for the same numbers, MATLAB, netCDF."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import flexlin
from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, check_size
from flexlin.control.designed_loop import Design
from flexlin.control.export.templates import fill_in
from flexlin.control.sampled import SampledGain
from flexlin.errors import ArgumentError, counted
from flexlin.files import replacing
from flexlin.linearization.law import Controller
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.control import RATE

Texts = dict[str, list[str]]
Variables = dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]
"""Axes, values and what netCDF says of them, by name."""
MATLAB_DESIGN = ("name", "samples", "K", "X", "rates", "states")
"""Fields of a design in MATLAB's file."""


@dataclass(frozen=True)
class Labels:
    """Names and units of the states [y; y'] and of the inputs."""

    states: tuple[str, ...]
    state_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]

    @classmethod
    def of(cls, lin: Linearization, controller: Controller | None = None) -> "Labels":
        """Those of an arm: q1, w11, ..., then q1_rate, ..., and of a controller, its loop's own where none is given.

        An input bears the name of the coordinate that it drives.
        """
        units = [coordinate.unit for coordinate in lin.coordinates]
        states = (*lin.names, *(name + RATE for name in lin.names))
        units += [f"{unit}/s" for unit in units]
        memory = lin.controller if controller is None else controller
        if memory is not None:
            states, units = (*states, *memory.names), [*units, *memory.units]
        return cls(states, tuple(units), lin.inputs, lin.input_units)

    @classmethod
    def fitting(
        cls, lin: Linearization | None, states: int, inputs: int, controller: Controller | None = None
    ) -> "Labels":
        """Those of the arm and of a design's controller, once they have been found to fit; without an arm, x1, x2 ... and u1, u2 ..."""
        if lin is None:
            names = (
                tuple(f"{letter}{i + 1}" for i in range(count)) for letter, count in (("x", states), ("u", inputs))
            )
            return cls(next(names), ("",) * states, next(names), ("",) * inputs)
        labels = cls.of(lin, controller)
        if (len(labels.states), len(labels.inputs)) != (states, inputs):
            got = f"{counted(len(labels.states), 'state')} and {counted(len(labels.inputs), 'input')}"
            raise ArgumentError("the arm does not fit what is exported", got=got, expected=f"{states} and {inputs}")
        return labels


@checked
def save(
    system: PeriodicSystem,
    path: str | Path,
    designs: tuple[Design, ...] = (),
    phases: int = SAMPLES,
    lin: Linearization | None = None,
) -> Path:
    """Write A(t), B(t) and the gains of designs over one period to a file.

    The arrays are t (N,), A (N, n, n), B (N, n, m), and K_<i>, X_<i> for each design, with `names` of the designs and `period`; the N
    times are equally spaced; samples_<i> are the gains of a sampled design at its own phases. `states`, `state_units`, `inputs` and
    `input_units` name the axes. In MATLAB's file time is the last axis, A is (n, n, N), and `designs` is a struct array of name, samples,
    K (m, n, N) and X (n, n, N). In netCDF every axis has names and units.

    Parameters
    ----------
    system : PeriodicSystem
        The system.
    path : str or Path
        The file. Its ending chooses the format: .npz (NumPy), .mat (MATLAB 5), .nc (netCDF 3).
    designs : tuple of Design
        Designs whose gains are written too.
    phases : int
        Times of a period.
    lin : Linearization, optional
        The arm, which gives states and inputs their names and units.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ArgumentError
        For another ending.
    TooLarge
        When the table would not fit into memory.
    OutputError
        When the file cannot be written; one of before is still there then.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-4.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with np.load(fl.control.save(system, f"{folder}/plant.npz", phases=8)) as content:
    ...         print(sorted(content), content["A"].shape)
    ['A', 'B', 'input_units', 'inputs', 'names', 'period', 'state_units', 'states', 't'] (8, 2, 2)
    """
    path = Path(path)
    with replacing(path) as temporary:
        write_system(system, temporary, designs, phases, lin)
    return path


def write_system(
    system: PeriodicSystem, path: Path, designs: tuple[Design, ...], phases: int, lin: Linearization | None = None
) -> None:
    """Write what `save` writes, into a set or under a temporary name."""
    numbers = system.n * (system.n + system.m) + len(designs) * system.n * (system.n + system.m)
    check_size(f"a table of {phases} times", 8 * phases * (numbers + 1), "ask for fewer phases (--points)")
    t = system.period * np.arange(phases) / phases
    row, column = "state_unit of the row", "state_unit of the column"
    words = {"long_name": "state matrix", "units": f"{row} / s / {column}"}
    table: Variables = {"A": (("time", "state", "state_"), system.A(t), words)}
    if system.B is not None:
        words = {"long_name": "input matrix", "units": f"{row} / s / input_unit"}
        table["B"] = ("time", "state", "input"), system.B(t), words
    for i, made in enumerate(designs):
        state, own = "state" if made.controller is None else f"state_{i}", {"design": made.name}
        words = {"long_name": f"gain of {made.name}, u = -K x", "units": f"input_unit / {column}", **own}
        table[f"K_{i}"] = ("time", "input", state), made.K(t), words
        if made.solution is not None:
            cost = {"long_name": f"Riccati solution of {made.name}", "units": f"1 / ({row} x {column})", **own}
            table[f"X_{i}"] = ("time", state, f"{state}_"), made.solution.X(t), cost
        if made.controller is not None:
            table[f"rates_{i}"] = (f"memory_{i}", state), made.controller.rates, {}
        if isinstance(made.K, SampledGain):
            words = words | {"long_name": f"gain of {made.name} at its samples"}
            table[f"samples_{i}"] = (f"phase_samples_{i}", "input", state), made.K.in_order, words
    texts = {"names": [made.name for made in designs]}
    texts |= {
        f"states_{i}": list(made.controller.names) for i, made in enumerate(designs) if made.controller is not None
    }
    texts |= {key: list(value) for key, value in asdict(Labels.fitting(lin, system.n, system.m)).items()}
    writers = {".npz": _save_npz, ".mat": _save_mat, ".nc": _save_netcdf}
    if path.suffix not in writers:
        raise ArgumentError("the file's ending names no known format", got=path.name, expected=", ".join(writers))
    writers[path.suffix](path, t, table, texts, system.period)


def _save_npz(path: Path, t: Array, table: Variables, texts: Texts, period: float) -> None:
    content: dict[str, Any] = {"t": t} | {key: values for key, (_, values, _) in table.items()}
    content |= {key: np.array(value, dtype=str) for key, value in texts.items()}
    np.savez_compressed(path, **content, period=np.array(period))


def _save_mat(path: Path, t: Array, table: Variables, texts: Texts, period: float) -> None:
    from scipy.io import savemat

    arrays = {key: values for key, (_, values, _) in table.items()}
    words = {key: np.array(value, dtype=object) for key, value in texts.items() if key != "names"}
    plant: dict[str, Any] = {key: np.moveaxis(arrays[key], 0, -1) for key in ("A", "B") if key in arrays}
    designs = np.zeros(len(texts["names"]), dtype=[(key, object) for key in MATLAB_DESIGN])
    for i, name in enumerate(texts["names"]):
        matrices = [np.moveaxis(arrays.get(f"{key}_{i}", np.zeros((0, 0, 0))), 0, -1) for key in ("samples", "K", "X")]
        rates = arrays.get(f"rates_{i}", np.zeros((0, arrays["A"].shape[1])))
        designs[i] = (name, *matrices, rates, np.array(texts.get(f"states_{i}", []), dtype=object))
    with path.open("wb") as file:
        content = {"t": t[None], **plant, **words, "designs": designs, "period": period}
        savemat(file, content)


def _save_netcdf(path: Path, t: Array, table: Variables, texts: Texts, period: float) -> None:
    """An entry's unit follows from those of its row and column."""
    import xarray

    of_state = {"long_name": "states [y; y'], deviations from the rigid motion", "units": "as in state_unit"}
    of_input = {"long_name": "inputs u, by the coordinate that they drive", "units": "as in input_unit"}
    coordinates: dict[str, Any] = {
        "time": ("time", t, {"long_name": "time in the period", "units": "s"}),
        "state": ("state", texts["states"], of_state),
        "state_": ("state_", texts["states"], of_state | {"long_name": "states, as columns"}),
        "state_unit": ("state", texts["state_units"]),
    }
    if "B" in table:
        coordinates |= {"input": ("input", texts["inputs"], of_input), "input_unit": ("input", texts["input_units"])}
    attributes = {"title": "x' = A(t) x + B(t) u over a period", "period": period, "period_units": "s"}
    attributes |= {"source": f"flexlin {flexlin.__version__}", "designs": "; ".join(texts["names"])}
    attributes |= {key: "; ".join(texts[key]) for key in ("state_units", "input_units")}
    path.write_bytes(xarray.Dataset(table, coordinates, attributes).to_netcdf(engine="scipy"))


def matlab_script(data: Path, designs: int, periodic: bool = True) -> Path:
    """Write the script beside a .mat file that `save` wrote with a number of designs; returns its path."""
    target = data.with_name("load_arm.m")
    keep, within, ends = 3, "mod(time, period)", ": a period, so three samples are repeated at either end"
    if not periodic:
        keep, within, ends = 0, "min(max(time, 0), t(end))", " of a motion that ends, held before and after it"
    words = {"data": data.name, "designs": designs, "version": flexlin.__version__}
    words |= {"keep": keep, "within": within, "ends": ends}
    target.write_text(fill_in("load_arm.m.in", words), encoding="utf-8")
    return target
