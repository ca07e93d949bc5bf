"""What flexlin writes for other programs holds plain numbers and texts: everything opens where pickled objects are refused."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import xarray

from flexlin.cli import main

SMALL = ["--set", "links.0.modes=1", "designs.0.name='=HYPERLINK(\"http://x\")'", "designs.1.name='+1 \u03a9'"]
COMMANDS = {
    "linearize": ["--points", "16"],
    "design": ["--points", "16"],
    "export": ["--points", "16"],
    "simulate": ["--periods", "0.5"],
    "chart": ["--over", "effects.payload.mass=0:0.1:6"],
}


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=[pytest.mark.slow] * (name != "linearize")) for name in COMMANDS]
)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The files of a command on a scene whose designs bear names that a spreadsheet would take for formulas."""
    folder = tmp_path_factory.mktemp(request.param)
    assert main([request.param, "single-link", *COMMANDS[request.param], *SMALL, "--out", str(folder)]) == 0
    return [path for path in folder.rglob("*") if path.is_file()]


def test_no_file_needs_pickle(written: list[Path]) -> None:
    opened = 0
    for path in written:
        found: dict = {}
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as archive:
                found = {name: archive[name] for name in archive.files}
        elif path.suffix == ".nc":
            found = {
                name: one.values
                for name, one in xarray.load_dataset(path, engine="scipy", decode_cf=False).variables.items()
            }
        elif path.suffix == ".mat":
            found = {"all": np.array(len(scipy.io.loadmat(path)))}
        opened += bool(found)
        assert all(array.dtype.kind in "biufcSU" for array in found.values()), path
    assert opened >= 1


def test_no_name_becomes_a_file_or_a_formula(written: list[Path]) -> None:
    """Names that others chose are contents, never names of files; and no table for spreadsheets is written."""
    for path in written:
        assert path.suffix in (".npz", ".nc", ".mat", ".m", ".json", ".html", ".c", ".h", ".txt", ".toml"), path
        assert not set("=+\"'()\u03a9 ") & set(path.name), path
