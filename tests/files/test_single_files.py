"""Files appear whole or not at all, also on a full disk, and open where pickled objects are refused."""

import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import xarray

from flexlin.cli import BAD_INPUT, main, program
from flexlin.errors import OutputError
from flexlin.files import replacing
from tests.files.reader import contents, interrupt, leftovers, standing


def test_a_failure_leaves_the_old_file_and_no_rest(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), replacing(path) as temporary:
        interrupt(temporary)
    assert contents(tmp_path) == {path: b"old"}


def test_a_folder_that_refuses_is_named(tmp_path):
    (tmp_path / "occupied").write_text("")
    with pytest.raises(OutputError, match="occupied"), replacing(tmp_path / "occupied" / "file.txt") as temporary:
        temporary.write_text("text")


def test_a_fault_of_the_program_is_one_line(capsys):
    try:
        [][1]
    except IndexError as fault:
        program.report_fault(IndexError, fault, sys.exc_info()[2])
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "test_single_files.py" in message
    assert "IndexError" in message


SCENE = ["khang-2019", "--points", "8", "--limit-seconds", "50"]


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """No file may grow beyond so many bytes; what is written then fails as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.slow
def test_a_full_disk_leaves_the_old_set(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["export", *SCENE, "--out", str(out)]) == 0
    before = contents(out)
    sizes = sorted(len(content) for content in before.values())
    capsys.readouterr()
    for size in (0, *sorted({one - 1 for one in sizes if one > 1})[::5], sizes[-1] - 1):
        with files_up_to(size):
            code = main(["export", *SCENE, "--set", "title='other'", "--out", str(out)])
        assert code == BAD_INPUT
        assert capsys.readouterr().err.count("out cannot be written; got ") == 1
        assert contents(out) == before, size
        assert leftovers(out) == []
    assert standing(out, "export")


SMALL = ["--set", "links.0.modes=1", "designs.0.name='=HYPERLINK(\"http://x\")'", "designs.1.name='+1 \u03a9'"]
COMMANDS = {
    "linearize": ["--points", "16"],
    "design": ["--points", "16"],
    "export": ["--points", "16"],
    "simulate": ["--periods", "0.5"],
    "chart": ["--over", "effects.payload.mass=0:0.1:6"],
}


@pytest.fixture(params=[pytest.param(name, marks=[pytest.mark.slow] * (name != "linearize")) for name in COMMANDS])
def written(request, tmp_path):
    """The files of a command on a scene whose designs bear names that a spreadsheet would take for formulas."""
    assert main([request.param, "single-link", *COMMANDS[request.param], *SMALL, "--out", str(tmp_path)]) == 0
    return list(contents(tmp_path))


def read_arrays(path: Path) -> list[np.ndarray]:
    """The arrays of a file, by readers that take no pickled objects."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as archive:
            return [archive[name] for name in archive.files]
    if path.suffix == ".nc":
        data = xarray.load_dataset(path, engine="scipy", decode_cf=False)
        return [one.values for one in data.variables.values()]
    return [np.array(len(scipy.io.loadmat(path)))] if path.suffix == ".mat" else []


def test_no_file_needs_pickle_and_no_name_becomes_a_file_or_a_formula(written):
    """Names that others chose are contents, never names of files; and no table for spreadsheets is written."""
    arrays = [array for path in written for array in read_arrays(path)]
    assert arrays
    assert all(array.dtype.kind in "biufcSU" for array in arrays)
    for path in written:
        assert path.suffix in (".npz", ".nc", ".mat", ".m", ".json", ".html", ".c", ".h", ".txt", ".toml"), path
        assert not set("=+\"'()\u03a9 ") & set(path.name), path
