"""docs/mechanics.md: its examples run as printed, and its table of effects is complete."""

import re
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import effects as tables

TEXT = (Path(__file__).parents[2] / "docs" / "mechanics.md").read_text(encoding="utf-8")


def test_the_table_names_every_effect_and_every_key():
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", TEXT.split("## Effects")[1].split("##")[0], re.MULTILINE))
    assert set(rows) == set(tables.known_effects())
    for name, keys in rows.items():
        assert set(re.findall(r"`(\w+)`", keys)) == set(tables.known_effects()[name].model_fields)


@pytest.fixture
def no_own_effects(monkeypatch):
    monkeypatch.setattr(tables, "_REGISTRY", tables.known_effects())


@pytest.mark.usefixtures("no_own_effects")
def test_examples_run():
    names: dict = {}
    for example in re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL):
        exec(compile(example, "docs/mechanics.md", "exec"), names)
    arm, bare = names["arm"], fl.build_manipulator(fl.load_scene("single-link"))
    assert arm.functions["g"].n_instructions() > bare.functions["g"].n_instructions()
    slider = names["slider"]
    assert slider.drives == (0,)
    np.testing.assert_allclose(np.array(slider.functions["M"]([0.0, 0.5], [])), [[4.25, 0], [0, 1]])
