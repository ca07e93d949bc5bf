"""What no arm can have is refused alike wherever it comes in: TOML, URDF, CSV, JSON, --set, quantities with units, ranges of a chart."""

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


CYCLE, WHOLE = sampled_cycle(), SCENE.format(number=0.2)
DOORS = {
    "toml": ("check {}/scene.toml", {"scene.toml": SCENE, "cycle.csv": CYCLE}),
    "table": ("check {}/scene.toml", {"scene.toml": WHOLE, "cycle.csv": CYCLE.replace("0.0,0.0", "0.0,{number}", 1)}),
    "first row, which is no line of names where it holds a number": (
        "check {}/scene.toml",
        {"scene.toml": WHOLE, "cycle.csv": CYCLE.replace("t,q1\n0.0,0.0", "0.0,{number}", 1)},
    ),
    "robot": ("import {}/robot.urdf --out {}/robot.toml", {"robot.urdf": ROBOT.replace("{mass}", "{number}")}),
    "set": ("check single-link --set effects.payload.mass={number}", {}),
    "a table on one line": ("check single-link --set effects.payload={mass={number}}", {}),
    "quantity": ("respond single-link --push tip_{number}_N_20_ms --out {}/out", {}),
    "range": ("chart single-link --over motion.frequency=0.5:{number} --out {}/out", {}),
}
"""A command, with _ for a space within a word and {} for its folder, and the files there."""


def knock(door: str, number: str, folder: Path) -> int:
    """The command's exit code."""
    words, files = DOORS[door]
    for name, text in files.items():
        (folder / name).write_text(text.replace("{number}", number))
    told = [word.replace("_", " ") if "tip_" in word else word for word in words.split()]
    return main([word.replace("{}", str(folder)).replace("{number}", number) for word in told])


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
        sys.exit(knock(door, number, tmp_path))
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert len(said) < 2000
    assert "fault" not in said


@pytest.mark.parametrize("door", list(DOORS)[:6])
def test_what_an_arm_can_have_is_let_in(door, tmp_path):
    assert knock(door, "0.0" if door in list(DOORS)[1:3] else "0.25", tmp_path) == 0


def test_read_number_reads_to_its_bounds():
    read = [read_number(text) for text in (" 1e30", "-1E30 ", ".5", "0" * (LONGEST_NUMBER - 1) + "7")]
    assert read == [LARGEST_NUMBER, -LARGEST_NUMBER, 0.5, 7.0]
