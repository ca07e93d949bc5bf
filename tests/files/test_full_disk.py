"""A disk that is full at any size of file: one message, exit code 2, and the results of before stand whole."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from flexlin.cli import BAD_INPUT, main
from tests.files.reader import leftovers, standing

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
def test_a_full_disk_leaves_the_old_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["export", *SCENE, "--out", str(out)]) == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    sizes = sorted(len(content) for content in before.values())
    capsys.readouterr()
    for size in (0, *sorted({one - 1 for one in sizes if one > 1})[::5], sizes[-1] - 1):
        with files_up_to(size):
            code = main(["export", *SCENE, "--set", "title='other'", "--out", str(out)])
        message = capsys.readouterr().err
        assert code == BAD_INPUT
        assert message.count("out cannot be written; got ") == 1
        assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before, size
        assert leftovers(out) == []
    assert standing(out, "export")
