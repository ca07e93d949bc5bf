"""Files and folders that would harm: outside the scene's own, without end, no files at all, or with names that nobody can write."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import flexlin as fl
from flexlin.cli import BAD_INPUT, main
from flexlin.errors import MotionError, SceneError
from flexlin.files import read_text
from tests.scene.hostile import ROWS, TEXT, linearized, with_table


@pytest.mark.parametrize("name", ["a\\u0000b", "x" * 5000, "loop"])
def test_names_of_tables_that_no_file_can_have(name, tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    path = tmp_path / "scene.toml"
    path.write_text(with_table(f'"{name}"'), encoding="utf-8")
    with pytest.raises((SceneError, MotionError), match=r"motion\.file") as caught:
        linearized(path)
    assert len(str(caught.value)) < 1000


def test_pipes_and_devices_are_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder"):
        (tmp_path / "scene.toml").write_text(with_table(f"'{name}'"), encoding="utf-8")
        scene = fl.load_scene(tmp_path / "scene.toml")
        with pytest.raises(MotionError, match=r"motion\.file.*regular file"):
            fl.linearize(fl.build_manipulator(scene), scene.motion)
    for source in ("pipe", "."):
        with pytest.raises(SceneError, match="no such file"):
            fl.load_scene(tmp_path / source)


@pytest.mark.slow
def test_a_scene_opens_no_file_outside_its_folder(tmp_path, capsys):
    """Neither by a path, nor by .., nor by a link; there is no telling whether such a file is there."""
    folder, secret = tmp_path / "scenes", tmp_path / "secret.csv"
    (folder / "below").mkdir(parents=True)
    secret.write_text("t,password\n" + ROWS + "hunter2,1\n", encoding="utf-8")
    (folder / "link.csv").symlink_to(secret)
    (folder / "out").symlink_to(tmp_path)
    path, said = folder / "scene.toml", set()
    for name in ("/dev/zero", "/etc/passwd", str(secret), "../secret.csv", "below/../../secret.csv", "link.csv", "out/secret.csv",
                 "../no-such.csv", ".", ".."):  # fmt: skip
        path.write_text(with_table(f"'{name}'"), encoding="utf-8")
        assert main(["check", str(path)]) == BAD_INPUT
        message = capsys.readouterr().err
        assert "expected a file below the scene's folder, or below a folder that you name (--data DIR)" in message
        said.add(message.replace(repr(name), "NAME"))
    assert len(said) == 1
    path.write_text(with_table("'secret.csv'"), encoding="utf-8")
    assert main(["check", str(path), "--data", str(tmp_path)]) == BAD_INPUT
    message = capsys.readouterr().err
    assert "motion.file" in message
    assert "row 13 is not numeric; got a cell that is none" in message
    assert "hunter2" not in message
    assert "password" not in message
    secret.write_text(ROWS, encoding="utf-8")
    assert main(["check", str(path), "--data", str(tmp_path)]) == 0
    assert fl.load_scene(path, data_folder=tmp_path).motion.file == str(secret)
    (folder / "below" / "own.csv").write_text(ROWS, encoding="utf-8")
    path.write_text(with_table("'below/own.csv'"), encoding="utf-8")
    assert main(["check", str(path)]) == 0


def test_a_scene_from_python_opens_no_file_outside_the_folder_that_one_works_in(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.csv").write_text(ROWS, encoding="utf-8")
    raw = {"schema": 1, "title": "", "links": [{"length": 1.0, "mass_per_length": 1.0}]}
    for name, fits in (
        ("own.csv", True),
        (str(tmp_path / "own.csv"), True),
        ("../own.csv", False),
        ("/etc/passwd", False),
    ):
        scene = {**raw, "motion": {"kind": "table", "file": name}}
        if fits:
            assert fl.parse_scene(scene).motion.file == str(tmp_path / "own.csv")
            assert scene["motion"]["file"] == name, "what was given stays as it was"
        else:
            with pytest.raises(SceneError, match=r"motion\.file"):
                fl.parse_scene(scene)


def test_files_without_end_are_not_read(tmp_path, monkeypatch):
    """A file of the system that states no size, and a table of more rows than any motion has."""
    with pytest.raises(OSError, match="more than 10 bytes"):
        read_text(Path("/proc/self/status"), 10)
    (tmp_path / "long.csv").write_text("0,0\n" * (2**18 + 1), encoding="utf-8")
    (tmp_path / "scene.toml").write_text(with_table("'long.csv'"), encoding="utf-8")
    with pytest.raises(MotionError, match="262145 rows, expected at most 262144"):
        linearized(tmp_path / "scene.toml")


def test_files_of_absurd_size_are_not_read(tmp_path):
    with (tmp_path / "big.csv").open("wb") as file:
        file.truncate(2**26 + 1)
    (tmp_path / "scene.toml").write_text(with_table("'big.csv'"), encoding="utf-8")
    scene = fl.load_scene(tmp_path / "scene.toml")
    with pytest.raises(MotionError, match="67,108,865 bytes"):
        fl.linearize(fl.build_manipulator(scene), scene.motion)
    with (tmp_path / "big.toml").open("wb") as file:
        file.truncate(2**20 + 1)
    with pytest.raises(SceneError, match="1,048,577 bytes"):
        fl.load_scene(tmp_path / "big.toml")


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    (tmp_path / "motion.csv").write_text("t,q\n" + ROWS, encoding="utf-8-sig")
    (tmp_path / "plain.csv").write_text(ROWS, encoding="utf-8-sig")
    for name in ("motion.csv", "plain.csv"):
        (tmp_path / "scene.toml").write_text(with_table(f"'{name}'"), encoding="utf-8-sig")
        scene = fl.load_scene(tmp_path / "scene.toml")
        lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
        assert lin.period == pytest.approx(1.0)


def test_a_name_that_no_scene_has(tmp_path, capsys):
    for name in ("x" * 5000, "y" * 300):
        assert main(["check", name]) == BAD_INPUT
        told = capsys.readouterr().err
        assert "name" in told or "no such file" in told
        assert len(told) < 1000
    with pytest.raises(SceneError, match="a name of 5000 characters"):
        fl.load_scene("x" * 5000)


@pytest.mark.slow
def test_a_file_name_that_is_not_utf_8(tmp_path):
    name = os.fsdecode(os.fsencode(tmp_path) + b"/\xff.toml")
    with pytest.raises(SceneError, match=r"udcff\.toml"):
        fl.load_scene(name)
    Path(name).write_text(TEXT, encoding="utf-8")
    run = subprocess.run([sys.executable, "-m", "flexlin", "check", name], capture_output=True, check=False)
    assert run.returncode == 0, run.stderr
    Path(name).write_text("schema = 2", encoding="utf-8")
    run = subprocess.run([sys.executable, "-m", "flexlin", "check", name], capture_output=True, check=False)
    assert run.returncode == BAD_INPUT
    assert b"udcff.toml" in run.stderr


@pytest.mark.slow
def test_a_folder_whose_name_is_not_utf_8_takes_results(tmp_path):
    out = os.fsdecode(os.fsencode(tmp_path) + b"/\xff")
    run = subprocess.run(
        [sys.executable, "-m", "flexlin", "export", "khang-2019", "--points", "8", "--out", out],
        capture_output=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert b"fault of flexlin" not in run.stderr, run.stderr
    assert run.returncode == 0, run.stderr
    assert [path.name for path in tmp_path.iterdir()] == [os.path.basename(out)]
    assert (Path(out) / "c" / "linearization.h").read_text().startswith("/*")


def test_places_that_cannot_be_written_are_named(tmp_path, capsys):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for place in (tmp_path / "a", tmp_path / "a" / "deeper", tmp_path / ("x" * 300)):
        assert main(["linearize", "single-link", "--out", str(place)]) == 2
        assert "cannot be the output folder" in capsys.readouterr().err
