"""What the README shows is run: its tour, its scene, its list of effects and commands."""

import re
import tomllib
from pathlib import Path

import pytest

from flexlin.cli import parser
from flexlin.scene import known_effects, parse_scene

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)
    assert found is not None
    return found.group(1)


@pytest.mark.slow
def test_the_tour_runs_and_says_what_it_promises(capsys):
    exec(compile(block("python"), "README.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "('q1', 'w11', 'w12') (2, 3, 3)"
    assert lines[1].startswith("stable ")
    assert lines[-1] == "unstable"


def test_the_scene_is_one_and_every_effect_is_in_the_table():
    assert parse_scene(tomllib.loads(block("toml"))).designs[0].kind == "periodic-lqr"
    assert [name for name in known_effects() if f"`{name}`" not in README] == []


def test_every_command_is_named(capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["--help"])
    listed = re.findall(r"^    ([a-z]+) ", capsys.readouterr().out, flags=re.MULTILINE)
    assert "report" in listed
    assert [command for command in listed if f"flexlin {command}" not in README] == []
