"""System, designs, coefficients and simulations as files for other tools."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray

import flexlin
from flexlin.analyses.judging import Loop
from flexlin.checks import check_size, memory_limit
from flexlin.control.designed_loop import Design, scene_feedback
from flexlin.control.export.c_source import write_estimator, write_gain, write_linearization
from flexlin.control.export.files import matlab_script, write_system
from flexlin.control.lqr import horizon_system
from flexlin.control.sensors import scene_sensors
from flexlin.control.tracking import scene_feedforward
from flexlin.errors import InputError
from flexlin.files import Results, results
from flexlin.linearization.linear import with_control
from flexlin.linearization.linearization import Linearization
from flexlin.motion import SymbolicMotion
from flexlin.report.numbers import record_tables
from flexlin.scene.scene import Scene

MATRIX, VECTOR = ("time", "row", "column"), ("time", "row")
TABLES = {
    "M": (MATRIX, "mass matrix M_L"),
    "D": (MATRIX, "matrix of y', D_L"),
    "K": (MATRIX, "matrix of y, K_L"),
    "h": (VECTOR, "forcing h_L that the rigid motion leaves over"),
    "B": (("time", "row", "input"), "input matrix B_L"),
    "tau": (("time", "input"), "feedforward torque of the rigid motion"),
    "D_loop": (MATRIX, "D_L with what of the scene's feedback answers at once"),
    "K_loop": (MATRIX, "K_L with what of the scene's feedback answers at once"),
    "h_loop": (VECTOR, "h_L with the scene's feedforward"),
}
EQUATION = "M y'' + D y' + K y = h + B u, deviations y from the rigid motion; joint rows in N m and rad, elastic rows in N and m"


def coefficients_dataset(scene: Scene, plant: Linearization, closed: Linearization, points: int) -> xarray.Dataset:
    """The coefficients at `points` equally spaced times of a period, without and with the scene's own loop."""
    check_points(points, 6 * plant.n * (plant.n + 1))
    t = plant.period * np.arange(points) / points
    free, loop = plant.sample(t), closed.sample(t)
    names = list(plant.names)
    data = xarray.Dataset(coords={"time": t, "row": names, "column": names, "input": list(plant.inputs)})
    for name, (dims, meaning) in TABLES.items():
        entry, _, own = name.partition("_")
        data[name] = dims, getattr(loop if own else free, entry), {"long_name": meaning}
    data = data.assign(controller_tables(closed))
    data["tau"].attrs["units"] = "N m"
    return described(data, scene, plant.period, EQUATION)


def controller_tables(closed: Linearization) -> dict[str, tuple[Any, ...]]:
    """Gain and rates of the scene's integrals and filters, if it has any: the loop is M y'' + D_loop y' + K_loop y = h_loop - B gain z."""
    controller = closed.controller
    if controller is None:
        return {}
    gain = closed.closed_by.gain(np.zeros(1))[0, :, 2 * closed.n :]
    subtracted = {"long_name": "what the controller's states z subtract from the torque"}
    rates = {"long_name": "z' as a function of [y; y'; z]"}
    return {
        "controller_gain": (("input", "memory"), gain, subtracted),
        "controller_rates": (("memory", "state"), controller.rates, rates),
        "memory": (("memory",), np.array(controller.names)),
    }


def gains_dataset(scene: Scene, plant: Linearization, designs: list[Design], points: int) -> xarray.Dataset:
    """The gains K(t) of designed controllers at `points` equally spaced times of a period."""
    check_points(points, 2 * len(designs) * plant.n * max(1, len(plant.inputs)))
    t = plant.period * np.arange(points) / points
    states = [*plant.names, *[f"{name}_rate" for name in plant.names]]
    controllers = [design.controller for design in designs if design.controller is not None]
    remembered = max((controller.names for controller in controllers), key=len, default=())
    gains = np.zeros((len(designs), points, max(1, len(plant.inputs)), len(states) + len(remembered)))
    for gain, design in zip(gains, designs, strict=True):
        gain[:, :, : design.closed_loop.n] = design.K(t)
    states += remembered
    names = [design.name for design in designs]
    axes = {"design": names, "time": t, "input": list(plant.inputs), "state": states}
    data = xarray.Dataset({"K": (list(axes), gains, {"long_name": "feedback gain"})}, axes)
    equation = "u = -K(t) [y; y'; integrals], beside the feedforward torque of the rigid motion"
    return described(data, scene, plant.period, equation)


def check_gains(scene: Scene, points: int) -> None:
    """Refuse gains at too many times before any is designed; what each has at the least is counted."""
    with memory_limit(scene.accuracy.memory):
        check_points(points, sum(max(2, len(table.state_weight or ())) for table in scene.designs))


def check_points(points: int, numbers: int) -> None:
    """Refuse a table of too many times, each with so many numbers."""
    check_size(f"a table of {points} times", 8 * points * (numbers + 2), "ask for fewer --points")


def described(data: xarray.Dataset, scene: Scene, period: float, equation: str) -> xarray.Dataset:
    """The data with what a reader needs to know: units, period, equation, the whole scene, the program."""
    data["time"].attrs["units"] = "s"
    data.attrs |= {
        "title": scene.title,
        "equation": equation,
        "units": "SI units and radians",
        "period": period,
        "scene": json.dumps(record_tables(scene)),
        "program": f"flexlin {flexlin.__version__}",
    }
    return data


def storable(data: xarray.Dataset) -> xarray.Dataset:
    """The data as netCDF can hold it: complex numbers parted into _re and _im; repeated texts as numbers that `flag_meanings` explains."""
    for name in [str(name) for name in data.data_vars if np.iscomplexobj(data[name])]:
        parts = {f"{name}_re": data[name].real, f"{name}_im": data[name].imag}
        named = {key: part.assign_attrs(data[name].attrs) for key, part in parts.items()}
        data = data.drop_vars(name).assign(named)
    for name in [str(name) for name in data.data_vars if data[name].dtype == object]:
        texts, codes = np.unique(data[name].values, return_inverse=True)
        flags = {"flag_values": np.arange(len(texts)), "flag_meanings": " | ".join(texts)}
        data = data.assign({name: (data[name].dims, codes.reshape(data[name].shape).astype(np.int32), flags)})
    return data


def write_dataset(data: xarray.Dataset, made: Results, stem: str) -> list[Path]:
    """Write `stem`.nc and `stem`.npz into a set of results; returns where they will stand."""
    names = f"{stem}.nc", f"{stem}.npz"
    (made / names[0]).write_bytes(data.to_netcdf(engine="scipy"))
    arrays: dict[str, Any] = {str(name): np.asarray(data[name].values) for name in data.variables}
    np.savez(made / names[1], **arrays)
    return made.placed(*names)


OWN = "c-own"
"""Folder of the scene's own feedback."""
FORMATS = (".npz", ".mat", ".nc")


def design_folders(names: Sequence[str]) -> dict[str, str]:
    """Return the folder of each design by its name: that in small Latin letters and digits, else its number among the designs.

    Parameters: names: of all designs of a scene, in their order (a design that failed keeps its number).
    Raises: InputError when two names lead to one folder, where the second gain would replace the first, or the scene's own feedback.
    """
    owners: dict[str, str] = {OWN: "the scene's own feedback"}
    for position, name in enumerate(names, start=1):
        words = re.sub(r"[^a-z0-9]+", "-", name.lower())[:60].strip("-")
        readable = words and (name.isascii() or re.search("[a-z]", words))
        folder = f"c-{words if readable else f'design-{position}'}"
        if folder in owners:
            got, expected = f"{owners[folder]!r} and {name!r}, both {folder}", "names that differ in letters or digits"
            wrong = "two designs would be written into one folder"
            raise InputError(wrong, got=got, expected=expected, todo="rename one of them")
        owners[folder] = name
    return {name: folder for folder, name in owners.items() if folder != OWN}


def export_all(plant: Linearization, loops: Sequence[Loop], folder: Path, points: int, scene: Scene) -> list[Path]:
    """Write A(t), B(t) and the gains over a period in every format, and C source of coefficients and gains, as one set.

    Each design has its C source in a folder named after it, the scene's own feedback in `c-own`; a motion that is given by numbers has no C
    source of its coefficients.
    Raises: InputError as `design_folders`, before anything is written.
    """
    folders = design_folders([loop.name for loop in loops])
    system = plant.periodic_system() if plant.motion.periodic else horizon_system(plant)
    designs = tuple(loop.design for loop in loops if loop.design is not None)
    # without a period there is no filter
    tables = {table.name: table.estimator for table in scene.designs if plant.motion.periodic}
    names = [f"system{ending}" for ending in FORMATS]
    with results(folder, "export") as made:
        for name in names:
            write_system(system, made / name, designs, points, plant)
        names.append(matlab_script(made / "system.mat", len(designs), plant.motion.periodic).name)
        if isinstance(plant.motion, SymbolicMotion):
            write_linearization(plant, made / "c")
            names.append("c")
        if scene.control.feedback is not None:
            closed = with_control(plant, scene.control)
            forward = scene_feedforward(closed, scene.accuracy.tol)
            law = closed.law if forward is None else forward.law
            write_gain(scene_feedback(closed), plant.period, made / OWN, plant, law)
            names.append(OWN)
        for found in designs:
            write_gain(found, plant.period, made / folders[found.name], plant)
            names.append(folders[found.name])
            if (table := tables.get(found.name)) is not None:
                sensors = scene_sensors(scene, plant, table)
                estimator = sensors.filter(plant, scene.accuracy.tol)
                write_estimator(estimator, made / folders[found.name], plant, sensors.names)
    return made.placed(*names)
