"""The house: every room of flexlin stands in the contract that imports point downward."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
OUTSIDE = {"__init__", "__main__"}
"""The two doors: the lazy public names, and `python -m flexlin`."""


def rooms(folder: Path) -> set[str]:
    """Packages and modules of a folder by name."""
    packages = {path.parent.name for path in folder.glob("*/__init__.py")}
    return packages | {path.stem for path in folder.glob("*.py")} - OUTSIDE


def contract(name: str) -> dict:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    return next(one for one in contracts if one["name"] == name)


def named(layers: list[str]) -> list[str]:
    return [word.removeprefix("flexlin.") for layer in layers for word in re.findall(r"[\w.]+", layer)]


def test_every_module_stands_in_a_layer():
    """A module in no layer may import what it likes, and be imported by anything: lint-imports says nothing about it."""
    layers = named(contract("imports point downward only")["layers"])
    assert sorted(layers) == sorted(rooms(ROOT / "flexlin"))


def test_every_room_of_the_numeric_wing_stands_in_a_layer():
    layers = named(contract("inside the numeric wing")["layers"])
    assert sorted(layers) == sorted(rooms(ROOT / "flexlin" / "periodic"))


def test_every_answer_stands_in_a_layer():
    layers = named(contract("answers build on each other without a circle")["layers"])
    assert sorted(layers) == sorted(rooms(ROOT / "flexlin" / "answers"))
