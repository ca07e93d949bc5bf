"""The compiled code of a new machine: made before any time counts, said in a line, and done without where it cannot be made."""

import argparse
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from flexlin import compiler
from flexlin.answers import kernels
from flexlin.cli.shared import compile_first
from flexlin.errors import TimeLimit
from flexlin.scene.accuracy import Accuracy

SOURCE = "double one(void) { return 1.0; }\n"


@pytest.fixture
def new_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache, a C file to compile into it, and a compiler that may be replaced: a script `gcc`, first on the path."""
    file = tmp_path / "one.c"
    file.write_text(SOURCE, encoding="utf-8")
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(kernels, "KERNELS", ((file,),))
    forget_machine()
    yield file
    monkeypatch.undo()
    forget_machine()


def forget_machine() -> None:
    """Have the compiler and its folder looked for anew."""
    for found in (
        compiler.find_compiler,
        compiler.describe_compiler,
        compiler.cache_folder,
        compiler.find_kept_library,
    ):
        found.cache_clear()


def put_compiler(file: Path, script: str) -> None:
    """A compiler that does what a shell script says; `$made` is the file that it is to make."""
    gcc = file.parent / "bin" / "gcc"
    gcc.write_text(f'#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done; made=$2\n{script}\n', encoding="utf-8")
    gcc.chmod(0o755)


def first_run() -> float:
    """By how much the begin of a run is put off."""
    options = argparse.Namespace(begun=10.0, tol=None)
    compile_first(options, Accuracy())
    return options.begun - 10.0


def test_what_compiling_takes_counts_for_no_limit(new_machine: Path, capfd: pytest.CaptureFixture[str]) -> None:
    if compiler.find_compiler() is None:
        pytest.skip("no C compiler")
    start = time.perf_counter()
    put_off = first_run()
    assert 0.0 < put_off <= time.perf_counter() - start
    assert capfd.readouterr().err.splitlines() == [
        "flexlin: numerical code is compiled for this processor, once: some seconds"
    ]
    library = compiler.find_kept_library(new_machine)
    assert library is not None
    assert not kernels.find_missing()
    assert first_run() == 0.0
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("script", ["exit 1", "kill -9 $$", "true"])
def test_a_compiler_that_fails_is_said_and_done_without(
    script: str, new_machine: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    put_compiler(new_machine, script)
    first_run()
    assert "failed" in capfd.readouterr().err.splitlines()[1]
    assert compiler.find_kept_library(new_machine) is None
    folder = compiler.find_kept_folder()
    assert folder is not None
    assert not list(folder.iterdir())


def test_a_library_that_cannot_be_loaded_is_done_without(new_machine: Path) -> None:
    put_compiler(new_machine, 'echo nothing of the kind > "$made"')
    assert compiler.find_kept_library(new_machine) is None


def test_nothing_is_compiled_where_nothing_can_be_kept(new_machine: Path, capfd: pytest.CaptureFixture[str]) -> None:
    put_compiler(new_machine, f"touch {new_machine.parent}/called")
    (new_machine.parent / "cache").write_text("a file in the place of the folder", encoding="utf-8")
    assert first_run() == 0.0
    assert capfd.readouterr().err == ""
    assert compiler.find_kept_library(new_machine) is None
    assert not (new_machine.parent / "called").exists()


def test_a_limit_that_is_met_while_compiling_is_no_failure_of_the_compiler(
    new_machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def late(source: str) -> None:
        raise TimeLimit("a stage: stopped at the time limit")

    monkeypatch.setattr(compiler, "load_library", late)
    with pytest.raises(TimeLimit):
        compiler.find_kept_library(new_machine)
