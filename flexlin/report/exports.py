"""System and designs as files for other tools."""

import re
from collections.abc import Sequence
from pathlib import Path

from flexlin.about.linear import Linearization, with_control
from flexlin.answers.judging import Loop
from flexlin.control.estimator import Estimator
from flexlin.control.export.c_estimator import write_estimator
from flexlin.control.export.c_gain import write_gain
from flexlin.control.export.c_linearization import write_linearization
from flexlin.control.export.files import write_system
from flexlin.control.export.matlab import matlab_script
from flexlin.control.from_scene import scene_feedback
from flexlin.control.horizon import horizon_system
from flexlin.control.sensors import scene_sensors
from flexlin.control.tracking import scene_feedforward
from flexlin.errors import InputError
from flexlin.files import results
from flexlin.motion import SymbolicMotion
from flexlin.scene.scene import Scene

OWN = "c-own"
"""Folder of the scene's own feedback."""
FORMATS = (".npz", ".mat", ".nc")
LONGEST = 60
"""Characters of a design's name that its folder keeps."""


def name_folder(name: str, position: int) -> str:
    """Return the folder of a design's C source: its name in small Latin letters and digits, else its number among the designs."""
    words = re.sub(r"[^a-z0-9]+", "-", name.lower())[:LONGEST].strip("-")
    readable = words and (name.isascii() or re.search("[a-z]", words))
    return f"c-{words if readable else f'design-{position}'}"


def design_folders(names: Sequence[str]) -> dict[str, str]:
    """Return the folder of each design by its name.

    Parameters: names: of all designs of a scene, in their order (a design that failed keeps its number).
    Raises: InputError when two names lead to one folder, where the second gain would replace the first, or the scene's own feedback.
    """
    owners: dict[str, str] = {OWN: "the scene's own feedback"}
    for position, name in enumerate(names, start=1):
        folder = name_folder(name, position)
        if folder in owners:
            raise InputError(
                "two designs would be written into one folder",
                got=f"{owners[folder]!r} and {name!r}, both {folder}",
                expected="names that differ in letters or digits",
                todo="rename one of them",
            )
        owners[folder] = name
    return {name: folder for folder, name in owners.items() if folder != OWN}


def export_all(
    plant: Linearization, loops: Sequence[Loop], folder: Path, points: int, scene: Scene | None = None
) -> list[Path]:
    """Write A(t), B(t) and the gains over a period in every format, and C source of coefficients and gains, as one set.

    Each design has its C source in a folder named after it, the scene's own feedback in `c-own`; a motion that is given by numbers has no C
    source of its coefficients.
    Raises: InputError as `design_folders`, before anything is written.
    """
    folders = design_folders([loop.name for loop in loops])
    system = plant.periodic_system() if plant.motion.periodic else horizon_system(plant)
    designs = tuple(loop.design for loop in loops if loop.design is not None)
    estimators = {} if scene is None else estimators_of(scene, plant, [found.name for found in designs])
    names = [f"system{ending}" for ending in FORMATS]
    with results(folder, "export") as made:
        for name in names:
            write_system(system, made / name, designs, points, plant)
        names.append(matlab_script(made / "system.mat", len(designs), plant.motion.periodic).name)
        if isinstance(plant.motion, SymbolicMotion):
            write_linearization(plant, made / "c")
            names.append("c")
        if scene is not None and scene.control.feedback is not None:
            closed = with_control(plant, scene.control)
            forward = scene_feedforward(closed, scene.accuracy.tol)
            law = closed.law if forward is None else forward.law
            write_gain(scene_feedback(closed), plant.period, made / OWN, lin=plant, law=law)
            names.append(OWN)
        for found in designs:
            write_gain(found, plant.period, made / folders[found.name], lin=plant)
            names.append(folders[found.name])
            if found.name in estimators:
                estimator, seen = estimators[found.name]
                write_estimator(estimator, made / folders[found.name], lin=plant, measurements=seen)
    return made.placed(*names)


def estimators_of(
    scene: Scene, plant: Linearization, names: Sequence[str]
) -> dict[str, tuple[Estimator, tuple[str, ...]]]:
    """The filters of the designs that name sensors, and what they measure; a motion that ends has none."""
    found = {}
    for table in scene.designs if plant.motion.periodic else ():
        if table.estimator is not None and table.name in names:
            sensors = scene_sensors(scene, plant, table.estimator)
            found[table.name] = sensors.filter(plant, scene.accuracy.tol), sensors.names
    return found
