"""The torture, small: nothing uncaught, nothing without a key, no set mixed or half, nothing left over."""

import json

import pytest


@pytest.mark.slow
@pytest.mark.parametrize(
    "part", ["check", "commands", "whole", "inputs", "kills", "files", "disks", "writers", "memory", "misuse"]
)
def test_torture(part, study, pictures, tmp_path, monkeypatch):
    module = study("torture")
    monkeypatch.setattr("tests.torture.whole_commands.SECONDS", 6.0)  # how punctual they are, the study measures
    monkeypatch.setattr("tests.torture.whole_commands.LATEST", 20.0)
    found = module.main("small", tmp_path, (part,), number=7)["rows"]
    if part == "disks" and not found:
        pytest.skip("this user may not mount a disk; tests/files/test_full_disk.py limits the size of files instead")
    (row,) = found
    assert row["wrong"] == []
    assert (row["uncaught"], row["keyless"], row["mixed"], row["left"]) == (0, 0, 0, 0)
    assert row["runs"] >= module.SIZES["small"][part]
    assert json.loads((tmp_path / f"torture-{part}-7.json").read_text())["runs"] == row["runs"]
    assert pictures["torture.svg"].axes[0].get_title().startswith("Runs")
