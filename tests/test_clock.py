"""A clock that is set back, as at the end of summer time, or by a server of time: limits and results do not depend on it."""

import json
import os
import time
from pathlib import Path

import pytest

from flexlin.answers import time_limit
from flexlin.cli import main
from flexlin.errors import TimeLimit
from flexlin.files import switch

SMALL = ["--points", "8", "--set", "links.0.modes=0", "designs=[]"]


@pytest.fixture
def back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at the clock of the day is an hour before the last."""
    now = [time.time()]

    def earlier() -> float:
        now[0] -= 3600.0
        return now[0]

    monkeypatch.setattr(time, "time", earlier)


@pytest.mark.usefixtures("back")
def test_a_limit_ends_in_its_time() -> None:
    start = time.perf_counter()

    def endless() -> None:
        while time.perf_counter() - start < 20.0:
            time.sleep(0.01)

    with pytest.raises(TimeLimit), time_limit("the stage", 0.1):
        endless()
    assert time.perf_counter() - start < 20.0


@pytest.mark.usefixtures("back")
def test_results_are_replaced_whole_and_leftovers_of_tomorrow_go(tmp_path: Path) -> None:
    """What a killed run has left bears a later time than what comes after it."""
    out = tmp_path / "out"
    assert main(["linearize", "single-link", *SMALL, "--out", str(out)]) == 0
    left = tmp_path / f"{switch.prefix_for('out')}1-left{switch.PART}"
    (left / switch.INNER).mkdir(parents=True)
    tomorrow = os.stat(out).st_mtime + 1e5
    for path in (left, out, *out.iterdir()):
        os.utime(path, (tomorrow, tomorrow))
    assert main(["linearize", "single-link", *SMALL, "title='again'", "--out", str(out)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    manifest = json.loads((out / "flexlin-results.json").read_text())
    assert set(manifest["sets"]["coefficients"]["sha256"]) == {"coefficients.nc", "coefficients.npz"}
