"""Numbers and texts without end, and places that cannot be written: a message each, in a time that does not grow with them."""

from pathlib import Path

import pytest

import flexlin as fl
from flexlin.cli import main
from flexlin.errors import SceneError

SCENE = """
schema = 1
title = "a strip"
[[links]]
length = {length}
mass_per_length = 0.2
bending_stiffness = 2.0
modes = 1
[motion]
kind = "harmonic"
frequency = 1.0
joints = [{{ amplitude = 0.1 }}]
"""


@pytest.mark.parametrize(
    "number",
    ["9" * 5000, "1" + "0" * 350, "0x" + "f" * 300, "0x" + "f" * 5000, "-" + "7" * 40, "1e" + "9" * 500, "1_0" * 400],
)
def test_a_number_without_end_in_a_file_is_a_mistake_of_the_file(number: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(length=number))
    with pytest.raises(SceneError, match=r"64 bits|400 characters"):
        fl.load_scene(path)


@pytest.mark.parametrize("number", [10**400, -(10**5000), 2**63], ids=["large", "endless", "65 bits"])
def test_so_it_is_in_python(number: int) -> None:
    with pytest.raises(SceneError, match=r"links\.0\.length: got a whole number beyond 64 bits"):
        fl.load_scene("single-link", {"links.0.length": number})
    with pytest.raises(SceneError, match=r"control\.feedback\.kp\.0"):
        fl.load_scene("single-link", {"control.feedback.kp": [number]})


def test_digits_in_texts_and_keys_are_no_numbers(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(length=1.0) + f"# {'9' * 5000}\n")
    assert fl.load_scene(path, {"source": "1" * 500}).source == "1" * 500


def test_a_title_without_end_is_refused() -> None:
    with pytest.raises(SceneError, match="title"):
        fl.load_scene("single-link", {"title": "x" * 900_000})


def test_many_mistakes_are_counted_not_described() -> None:
    with pytest.raises(SceneError) as found:
        fl.load_scene("single-link", {f"wrong{k}": 1 for k in range(5000)})
    assert len(found.value.problems) < 300
    assert "4800 further mistakes" in found.value.problems[-1].got


def test_places_that_cannot_be_written_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for place in (tmp_path / "a", tmp_path / "a" / "deeper", tmp_path / ("x" * 300)):
        assert main(["linearize", "single-link", "--out", str(place)]) == 2
        assert "cannot be the output folder" in capsys.readouterr().err
