"""The README and pages of docs/ run as they are printed, mean what they say, and their tables are complete."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin.cli import parser
from flexlin.scene import effects as tables
from flexlin.scene import parse_scene


def test_the_table_names_every_effect_and_every_key():
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", MECHANICS.split("## Effects")[1].split("##")[0], re.MULTILINE))
    assert set(rows) == set(tables.known_effects())
    for name, keys in rows.items():
        assert set(re.findall(r"`(\w+)`", keys)) == set(tables.known_effects()[name].model_fields)


DOCS = Path(__file__).parents[2] / "docs"
MECHANICS = (DOCS / "mechanics.md").read_text(encoding="utf-8")


def run_examples(name):
    """The names that the examples of a page leave behind."""
    names: dict = {}
    for example in re.findall(r"```python\n(.*?)```", (DOCS / name).read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(example, name, "exec"), names)
    return names


def test_examples_of_taylor_maps():
    names = run_examples("taylor.md")
    c, u0, du = names["c"], names["u0"], np.array([0.05, -0.02])
    assert c.error(du) == pytest.approx(np.linalg.norm(c(du) - c.refined(du)), rel=0.05)
    assert names["r"].kind == "real singularity"
    assert float(names["r"]) == pytest.approx(np.sqrt(4 - u0[1] ** 2) - u0[0], abs=1e-9)  # stretched at |u| = 2


def test_examples_of_mechanics(monkeypatch):
    monkeypatch.setattr(tables, "_REGISTRY", tables.known_effects())
    names, bare = run_examples("mechanics.md"), fl.build_manipulator(fl.load_scene("single-link"))
    assert names["arm"].functions["g"].n_instructions() > bare.functions["g"].n_instructions()
    assert names["slider"].drives == (0,)
    np.testing.assert_allclose(names["slider"].functions["M"]([0.0, 0.5], []).full(), [[4.25, 0], [0, 1]])


@pytest.mark.slow
def test_examples_of_control_print_what_the_page_says(capsys):
    run_examples("control.md")
    expected = re.findall(r"# -> (.*)", (DOCS / "control.md").read_text(encoding="utf-8"))
    assert capsys.readouterr().out.split() == " ".join(expected).split()
    assert len(expected) == 12


README = (DOCS.parent / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    return re.search(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)[1]


@pytest.mark.slow
def test_the_tour_runs_and_says_what_it_promises(capsys):
    exec(compile(block("python"), "README.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "('q1', 'w11', 'w12') (2, 3, 3)"
    assert lines[1].startswith("stable ")
    assert lines[-1] == "unstable"


def test_the_scene_is_one_and_every_effect_is_in_the_table():
    assert parse_scene(tomllib.loads(block("toml"))).designs[0].kind == "periodic-lqr"
    assert [name for name in tables.known_effects() if f"`{name}`" not in README] == []


def test_every_command_is_named(capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["--help"])
    listed = re.findall(r"^    ([a-z]+) ", capsys.readouterr().out, flags=re.MULTILINE)
    assert "report" in listed
    assert [command for command in listed if f"flexlin {command}" not in README] == []
