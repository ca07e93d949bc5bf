"""A scene to spoil, a motion read from a table, and what such scenes are refused for."""

import re
from pathlib import Path

import pytest

import flexlin as fl
from flexlin.errors import SceneError
from flexlin.scene import builtin_scenes

TEXT = builtin_scenes()["single-link"].read_text(encoding="utf-8")
TABLE = "[motion]\nkind = 'table'\nfile = {}\n\n"
ROWS = "".join(f"{0.1 * k},{0.1 * k * (1 - k / 10):.6f}\n" for k in range(11))


def with_table(name: str) -> str:
    """The single link, moved by a table."""
    return re.sub(r"\[motion\].*?(?=\[control\])", lambda _: TABLE.format(name), TEXT, flags=re.DOTALL)


def linearized(path: Path) -> fl.Linearization:
    """Load a scene, with all that its motion needs."""
    scene = fl.load_scene(path)
    return fl.linearize(fl.build_manipulator(scene), scene.motion)


def problem_of(raw: str, folder: Path, key: str) -> str:
    """Write and load a scene that must be refused for one key; returns the problem."""
    path = folder / "scene.toml"
    path.write_text(raw, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        fl.load_scene(path)
    found = [str(problem) for problem in caught.value.problems if problem.key == key]
    assert found, caught.value
    return found[0]
