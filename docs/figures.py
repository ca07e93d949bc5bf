"""What the pages of docs/ show in figures, so that no number in them is typed by hand.

A mark `<!-- built: NAME -->` of a page becomes the output of one function when the site is built. Cheap blocks are computed anew; those
that take minutes, or are times, are rendered by recorded_blocks.py from docs/measured/NAME.json with date and machine.

    python docs/figures.py --measure NAME ... run studies in full and keep their results in docs/measured (minutes, needs flexlin[peers])
    python docs/figures.py --pictures         draw the small pictures of docs/studies.md
"""

import argparse
import ast
import re
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import recorded_blocks as recorded
from records import DOCS, MEASURES, STUDIES, measure
from reference_tables import commands, scene
from tables import table
from thumbnails import PICTURES, draw_pictures

ROOT = DOCS.parent
MARK = re.compile(r"<!-- built: ([\w-]+) -->")


def hard_cases() -> str:
    """Every hard case, computed anew (half a minute)."""
    return import_module("tests.periodic.hard_cases").table()


def tracking() -> str:
    """What remains of the tip's error under each kind of feedforward, computed anew."""
    import flexlin as fl
    from flexlin import control

    scene = fl.load_scene("single-link")
    loop = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    fed = {
        "rigid": "torque of the rigid arm",
        "joint-exact": "torque that keeps the joint exactly on its path",
        "tip-exact": "torque and joint motion that keep each link's end on its line",
    }
    rows = [
        [f"`{kind}`", what, f"{1e3 * control.feedforward(loop, kind).tip_error:.2g} mm"] for kind, what in fed.items()
    ]
    return table(["kind", "fed forward", "what remains on the shipped link at 0.5 Hz"], rows)


def second_frequency(shapes: str, modes: int) -> float:
    """Of the arm of De Luca and Siciliano at rest, stretched out, joints locked, undamped, in rad/s."""
    import numpy as np
    from scipy.linalg import eigh

    import flexlin as fl

    rest = {"kind": "harmonic", "frequency": 1.0, "drive": "prescribed", "joints": [{"amplitude": 0.0}] * 2}
    scene = fl.load_scene(
        "de-luca-siciliano-1991",
        {
            **{f"links.{i}.{key}": value for i in (0, 1) for key, value in (("modes", modes), ("mode_shapes", shapes))},
            "motion": rest,
            "control": {},
            "effects.modal_damping": "off",
        },
    )
    c = fl.linearize(fl.build_manipulator(scene), scene.motion).sample(np.zeros(1))
    return float(np.sqrt(eigh(c.K[0], c.M[0], eigvals_only=True)[1]))


def mode_shapes() -> str:
    """How far the second frequency of a loaded two-link arm is off, by shapes and their number."""
    exact = second_frequency("clamped-loaded", 12)
    rows = [
        [
            str(modes),
            *[f"{second_frequency(shapes, modes) / exact - 1:.1e}" for shapes in ("clamped-free", "clamped-loaded")],
        ]
        for modes in (2, 4, 8)
    ]
    return table(["modes a link", "`clamped-free`", "`clamped-loaded`"], rows)


def tasks() -> str:
    """Every task page with its first paragraph, in the order of their index."""
    index = (DOCS / "tasks" / "index.md").read_text(encoding="utf-8").partition(":hidden:")[2]
    rows = []
    for name in re.findall(r"^[a-z-]+$", index, re.MULTILINE):
        title, *parts = (DOCS / "tasks" / f"{name}.md").read_text(encoding="utf-8").partition("\n# ")[2].split("\n\n")
        first = next(part for part in parts if not part.startswith("#"))
        rows.append([f"[{title}]({name}.md)", first.replace("\n", " ")])
    return table(["task", "what it does"], rows)


def studies() -> str:
    """Every study with the question that it asks, and its picture."""
    rows = []
    for path in sorted(STUDIES.glob("*.py")):
        question = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").splitlines()[0]
        picture = f"![{path.stem}](pictures/{path.stem}.png)" if (PICTURES / f"{path.stem}.png").exists() else ""
        rows.append([f"[`{path.stem}`](../studies/{path.name})", question, picture])
    return table(["study", "question", "its picture"], rows)


def licences() -> str:
    """The packages that flexlin stands on, with the licence that each states."""
    return table(["package", "licence", "needed"], import_module("licences").rows())


BLOCKS: dict[str, Callable[[], str]] = {
    "commands": commands,
    "scene": scene,
    "hard-cases": hard_cases,
    "compiled-peers": recorded.compiled_peers,
    "cost-of-accuracy": recorded.cost_of_accuracy,
    "taylor-cost": recorded.taylor_cost,
    "taylor-variables": recorded.taylor_variables,
    "charts-speed": recorded.charts_speed,
    "riccati-race": recorded.riccati_race,
    "own-error": recorded.own_error,
    "scaling": recorded.scaling,
    "tracking": tracking,
    "mode-shapes": mode_shapes,
    "studies": studies,
    "tasks": tasks,
    "licences": licences,
    "torture": recorded.torture,
    "tuning-grid": recorded.tuning_grid,
}


def fill(text: str) -> str:
    """A page's source with its blocks in their places."""
    return MARK.sub(lambda match: BLOCKS[match[1]](), text)


def main(arguments: list[str] | None = None) -> None:
    """Measure or draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--measure", nargs="+", choices=MEASURES, default=[])
    parser.add_argument("--pictures", nargs="*", choices=[path.stem for path in STUDIES.glob("*.py")])
    options = parser.parse_args(arguments)
    for name in options.measure:
        measure(name)
    if options.pictures is not None:
        draw_pictures(options.pictures or sorted(path.stem for path in STUDIES.glob("*.py")))


if __name__ == "__main__":
    main()
