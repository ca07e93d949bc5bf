"""What no arm can have is refused alike wherever it comes in: TOML, URDF, CSV, JSON, --set, quantities with units, ranges of a chart."""

import json
import sys
from pathlib import Path

import pytest

from flexlin.bounds import LARGEST_NUMBER, LONGEST_NUMBER, read_number
from flexlin.cli import main
from tests.torture.accidents import ROBOT
from tests.torture.scenes import sampled_cycle

SCENE = """
schema = 1
title = "a strip"
[[links]]
length = 1.0
mass_per_length = {number}
[motion]
kind = "table"
file = "cycle.csv"
"""


def of_toml(folder: Path, number: str, density: str = "", old: str = "", new: str = "") -> list[str]:
    """A scene with a table of its motion beside it."""
    (folder / "cycle.csv").write_text(sampled_cycle().replace(old, new, 1))
    (folder / "scene.toml").write_text(SCENE.format(number=density or number))
    return ["check", str(folder / "scene.toml")]


def of_table(folder: Path, number: str) -> list[str]:
    return of_toml(folder, number, "0.2", "0.0,0.0\n", f"0.0,{number}\n")


def of_first_row(folder: Path, number: str) -> list[str]:
    """Which is no line of names where it holds a number."""
    return of_toml(folder, number, "0.2", "t,q1\n0.0,0.0\n", f"0.0,{number}\n")


def of_robot(folder: Path, number: str) -> list[str]:
    (folder / "robot.urdf").write_text(ROBOT.format(mass=number))
    return ["import", str(folder / "robot.urdf"), "--out", str(folder / "robot.toml")]


def of_set(folder: Path, number: str) -> list[str]:
    return ["check", "single-link", "--set", f"effects.payload.mass={number}"]


def of_json(folder: Path, number: str) -> list[str]:
    """A scene as JSON says it, which is TOML where a value stands on one line."""
    whole = json.dumps({"mass": 0.03}).replace("0.03", number).replace(":", "=").replace('"', "")
    return ["check", "single-link", "--set", f"effects.payload={whole}"]


def of_quantity(folder: Path, number: str) -> list[str]:
    return ["respond", "single-link", "--push", f"tip {number} N 20 ms", "--out", str(folder / "out")]


def of_range(folder: Path, number: str) -> list[str]:
    return ["chart", "single-link", "--over", f"motion.frequency=0.5:{number}", "--out", str(folder / "out")]


DOORS = [of_toml, of_table, of_first_row, of_robot, of_set, of_json, of_quantity, of_range]
NUMBERS = {
    "digits": "9" * 5000,
    "decimals": "0." + "1" * 5000,
    "exponent": "1e999",
    "an endless exponent": "1e" + "9" * 500,
    "beyond an arm's": "1e31",
    "below": "-1e31",
    "no number": "nan",
    "infinite": "inf",
}


@pytest.mark.parametrize("number", NUMBERS.values(), ids=NUMBERS)
@pytest.mark.parametrize("door", DOORS)
def test_no_door_lets_it_in(door, number, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:  # from the reader of the command line, or as the program ends
        sys.exit(main(door(tmp_path, number)))
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert len(said) < 2000
    assert "fault" not in said


@pytest.mark.parametrize("door", DOORS[:6])
def test_what_an_arm_can_have_is_let_in(door, tmp_path):
    assert main(door(tmp_path, "0.0" if door in (of_table, of_first_row) else "0.25")) == 0


@pytest.mark.parametrize("wrong", ["", "x", "1" * (LONGEST_NUMBER + 1), "1e31", "nan", "-inf", "1,5"])
def test_read_number_refuses(wrong):
    with pytest.raises(ValueError, match=r"a number from -1e\+30 to 1e\+30"):
        read_number(wrong)


def test_read_number_reads_to_its_bounds():
    read = [read_number(text) for text in (" 1e30", "-1E30 ", ".5", "0" * (LONGEST_NUMBER - 1) + "7")]
    assert read == [LARGEST_NUMBER, -LARGEST_NUMBER, 0.5, 7.0]
