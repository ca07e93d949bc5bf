"""System and designs as files for other tools."""

import re
from collections.abc import Sequence
from pathlib import Path

from flexlin.about.linear import Linearization
from flexlin.answers.analysis import Loop
from flexlin.control import gain_source, linearization_source, save
from flexlin.files import replacing, replacing_folder
from flexlin.motion import SymbolicMotion

FORMATS = (".npz", ".mat", ".nc")


def export_all(plant: Linearization, loops: Sequence[Loop], folder: Path, points: int) -> list[Path]:
    """Write A(t), B(t) and the gains over a period in every format, and C source of coefficients and gains.

    Each design has its C source in a folder named after it; a motion that is given by numbers has no C source of its coefficients.
    """
    system, designs = plant.periodic_system(), tuple(loop.design for loop in loops if loop.design is not None)
    paths = [folder / f"system{ending}" for ending in FORMATS]
    for path in paths:
        with replacing(path) as temporary:
            save(system, temporary, designs, points)
    if isinstance(plant.motion, SymbolicMotion):
        with replacing_folder(folder / "c") as temporary:
            linearization_source(plant, temporary)
        paths.append(folder / "c")
    for made in designs:
        target = folder / f"c-{re.sub(r'[^A-Za-z0-9]+', '-', made.name).strip('-').lower()}"
        with replacing_folder(target) as temporary:
            gain_source(made, plant.period, temporary)
        paths.append(target)
    return paths
