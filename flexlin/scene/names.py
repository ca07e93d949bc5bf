"""Plain names and units of a scene's numbers, for axes and sentences."""

from itertools import pairwise

from flexlin.scene.base import Table
from flexlin.scene.library import registered_model
from flexlin.scene.parameters import PARAMETERS, get_value, path_in
from flexlin.scene.problems import checked_table
from flexlin.scene.scene import Scene

TABLES = {"parameters", "motion", "effects", "control", "feedback", "links", "joints"}
"""Steps of a path that say where a number stands, not what it is."""
WORDS = {"kp": "stiffness of the feedback", "kd": "damping of the feedback"}


def name_number(path: str) -> str:
    """A dotted path in plain words: motion.frequency -> motion frequency, links.0.length -> length of link 1."""
    steps = path.split(".")
    if steps[0] == "motion" and len(steps) == 2:
        return f"motion {steps[1].replace('_', ' ')}"
    placed = [(table, index) for table, index in pairwise(steps) if table in ("links", "joints") and index.isdigit()]
    place = "".join(f" of {'link' if table == 'links' else 'joint'} {int(index) + 1}" for table, index in placed)
    kept = [WORDS.get(step, step.replace("_", " ")) for step in steps if step not in TABLES and not step.isdigit()]
    alone, of = steps[-1].isdigit() and not place, "link" if "payload" in steps else "joint"
    return " ".join(kept or [path]) + place + (f" of {of} {int(steps[-1]) + 1}" if alone else "")


def name_unit(scene: Scene, path: str) -> str:
    """The unit of the number at a dotted path; empty where it has none or none is stated, without dimensions of all but angles.

    Of `rad or m` the first: no scene says so where its joints slide.
    """
    steps, unit = path_in(scene, path).split("."), ""
    checked = scene
    if steps[0] == PARAMETERS:  # of a registered model's own table, whose keys know their units, not of the raw one
        table = checked_table(registered_model(str(scene.model)).schema, scene.parameters, scene.title, PARAMETERS)
        checked = scene.model_copy(update={PARAMETERS: table})
    node: object = checked
    for k, step in enumerate(steps):
        if isinstance(node, Table):
            unit = type(node).units().get(step, "")
        node = get_value(checked, ".".join(steps[: k + 1]))
    unit = unit if any(link.joint == "prismatic" for link in scene.links) else unit.split(" or ")[0]
    return unit if scene.unit_system != "dimensionless" or unit == "rad" else ""


def label_number(scene: Scene, path: str) -> str:
    """The name with its unit, as on an axis: payload mass in kg."""
    unit = show_unit(scene, path)
    return name_number(path) + (f" in {unit}" if unit else "")


def show_unit(scene: Scene, path: str) -> str:
    """The unit with its powers raised: m/s²."""
    return name_unit(scene, path).replace("^2", "²").replace("^3", "³").replace("^4", "⁴")
