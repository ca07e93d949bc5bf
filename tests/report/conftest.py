"""One analysis of the single link for all tests of the report, and whole reports as the command writes them."""

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

import flexlin as fl
from flexlin.analyses import Analysis, analyse
from flexlin.cli import main


@pytest.fixture(scope="session")
def single_link() -> Analysis:
    return analyse(fl.load_scene("single-link", {"links.0.modes": 1, "designs": []}))


@pytest.fixture
def report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., SimpleNamespace]:
    """Runs `flexlin report`: exit code, report.json, report.html, and what was printed."""

    def run(*arguments: str) -> SimpleNamespace:
        code = main(["report", *arguments, "--out", str(tmp_path)])
        data, page = ((tmp_path / name).read_text(encoding="utf-8") for name in ("report.json", "report.html"))
        printed = capsys.readouterr()
        files = {path.name for path in tmp_path.iterdir()}
        said = {"code": code, "out": printed.out, "err": printed.err}
        return SimpleNamespace(files=files, data=json.loads(data), page=page, **said)

    return run
