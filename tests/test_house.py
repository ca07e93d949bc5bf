"""The house: every room of flexlin stands in the contract that imports point downward."""

import ast
import re
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
OUTSIDE = {"__init__", "__main__"}
"""The two doors: the lazy public names, and `python -m flexlin`."""


def rooms(folder: Path) -> set[str]:
    """Packages and modules of a folder by name."""
    packages = {path.parent.name for path in folder.glob("*/__init__.py")}
    return packages | {path.stem for path in folder.glob("*.py")} - OUTSIDE


def contract(name: str) -> dict:
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    return next(one for one in tools["importlinter"]["contracts"] if one["name"] == name)


def named(layers: list[str]) -> list[str]:
    return [word.removeprefix("flexlin.") for layer in layers for word in re.findall(r"[\w.]+", layer)]


CONTRACTS = [
    ("imports point downward only", "."),
    ("inside the numeric wing", "periodic"),
    ("analyses build on each other without a circle", "analyses"),
]


@pytest.mark.parametrize(("name", "folder"), CONTRACTS)
def test_every_module_stands_in_a_layer(name, folder):
    """A module in no layer may import what it likes, and be imported by anything: lint-imports says nothing about it."""
    assert sorted(named(contract(name)["layers"])) == sorted(rooms(ROOT / "flexlin" / folder))


def imported(path: Path, modules: set[str]) -> set[str]:
    """The modules of flexlin that a file imports anywhere, also inside functions and for type checkers."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {one if (one := f"{node.module}.{alias.name}") in modules else node.module for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found & modules


@pytest.mark.slow
def test_no_module_imports_itself_by_way_of_others():
    """lint-imports looks at rooms; this looks inside them. A circle is named by graphlib's error."""
    files = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts) for path in (ROOT / "flexlin").rglob("*.py")}
    names = {path: name.removesuffix(".__init__") for path, name in files.items()}
    modules = set(names.values())
    graph = {name: imported(path, modules) - {name} for path, name in names.items()}
    assert len(list(TopologicalSorter(graph).static_order())) == len(modules) > 200
