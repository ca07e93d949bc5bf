"""Files appear whole or not at all."""

import sys
from pathlib import Path

import pytest

from flexlin.cli import main, program
from flexlin.errors import OutputError
from flexlin.files import replacing


def write_text(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def test_a_file_is_written_whole(tmp_path: Path) -> None:
    write_text(tmp_path / "new" / "file.txt", "µ")
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["file.txt"]
    assert (tmp_path / "new" / "file.txt").read_text(encoding="utf-8") == "µ"


def test_a_failure_leaves_the_old_file_and_no_rest(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    path.write_text("old")

    def fail() -> None:
        with replacing(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["file.txt"]


def test_a_folder_that_refuses_is_named(tmp_path: Path) -> None:
    (tmp_path / "occupied").write_text("")
    with pytest.raises(OutputError, match="occupied"):
        write_text(tmp_path / "occupied" / "file.txt", "text")


def test_an_interrupt_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("flexlin.scene.library.builtin_scenes", interrupt)
    assert main(["list"]) == program.FAILED
    assert capsys.readouterr().err.count("\n") == 1


def test_a_fault_of_the_program_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    try:
        [][1]
    except IndexError as fault:
        program.report_fault(IndexError, fault, sys.exc_info()[2])
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "test_single_files.py" in message
    assert "IndexError" in message
