"""minimal.toml: the scene with just what it needs, ready to run, with the error that it makes."""

from typing import TYPE_CHECKING

from flexlin.errors import SceneError
from flexlin.report.wording import format_figures
from flexlin.scene.loading import parse_scene
from flexlin.scene.scene import Scene
from flexlin.scene.toml import write_toml

if TYPE_CHECKING:
    from flexlin.answers.audit.result import Audit, Minimal, Row


def minimal_text(audit: "Audit", minimal: "Minimal", command: str = "") -> str:
    """The scene as TOML below comments that say what it lacks, what that changes, and what the audit would add."""
    scene, left = fitting(minimal.scene)
    found = minimal.error
    said = [
        f"{command or 'flexlin effects'}: the smallest scene that was found to be enough at a tolerance of {audit.tolerance:g}.",
        f"Dropped: {', '.join(minimal.dropped) or 'nothing'}.",
        f"Added: {', '.join(minimal.added) or 'nothing'}.",
        f"Its error, against the scene{' with these modes' if minimal.added else ''}: {describe_error(found)}.",
        *left,
        *[
            f"Left out as in the scene, but it would be noticed with these figures: {row.subject} ({format_figures(row.table, row.units)})."
            for row in audit.effects
            if not row.on and row.significance > audit.tolerance
        ],
    ]
    data = scene.model_dump(mode="json", by_alias=True, exclude_unset=True)
    return "".join(f"# {line}\n" for line in said) + "\n" + write_toml(data)


def describe_error(row: "Row") -> str:
    """What the minimal scene changes, in one line."""
    return (
        f"{100 * row.significance:.2g} % (growth rate {row.margin:+.2g} 1/s, slower frequencies {100 * row.frequency:.2g} %, "
        f"tip path {100 * row.path:.2g} %, torques {100 * row.torque:.2g} %)"
    )


def fitting(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene without designs whose weights are a list for a number of states that it no longer has; and what is said of them."""
    kept = []
    for design in scene.designs:
        alone = scene.model_copy(update={"designs": (design,)})
        try:
            parse_scene(alone.model_dump(mode="json", by_alias=True, exclude_unset=True))
        except SceneError:
            continue
        kept.append(design)
    gone = [design.name for design in scene.designs if design not in kept]
    said = (
        [f"Designs whose lists of weights do not fit its coordinates were left out: {', '.join(gone)}."] if gone else []
    )
    return scene.model_copy(update={"designs": tuple(kept)}), said
