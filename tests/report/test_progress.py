"""Progress: shares of parts of parts add up, nothing is said of short work, lines in a pipe and not too many."""

import io
import time

import pytest

from flexlin.analyses import Clock
from flexlin.cli import Progress
from flexlin.cli import shared as shown
from flexlin.resources import advance, listening, part
from flexlin.scene import Accuracy


def test_parts_of_parts_say_shares_of_the_whole() -> None:
    said: list[float] = []
    with listening(said.append):
        advance(0.1)
        with part(0.2, 0.6):
            advance(0.5)
            with part(0.5, 1.0):
                advance(0.5)
                advance(7.0)
        advance(0.9)
    advance(0.3)  # nobody listens any more
    assert said == pytest.approx([0.1, 0.2, 0.4, 0.4, 0.5, 0.6, 0.6, 0.6, 0.9])


def test_the_listener_of_before_is_back_after_an_error() -> None:
    said: list[float] = []
    with listening(said.append):
        with pytest.raises(ValueError, match="lost"), part(0.5, 1.0):
            raise ValueError("lost")
        advance(0.25)
    assert said == [0.5, 0.25]


def test_planned_stages_share_the_work_alike() -> None:
    said: list[float] = []
    clock = Clock(planned=4)
    with listening(said.append):
        for _ in range(5):  # one more than was planned
            clock.stage("stage", Accuracy(), lambda: advance(0.5))
    assert said == sorted(said)
    assert 0.375 in said
    assert said[-1] <= 1.0


def open_pipe(monkeypatch: pytest.MonkeyPatch, patience: float) -> io.StringIO:
    """Standard error of a program."""
    for name, seconds in {"SILENT_SECONDS": patience, "LOOK_INTERVAL": 0.01, "PROGRESS_SECONDS": 0.1}.items():
        monkeypatch.setattr(shown, name, seconds)
    pipe = io.StringIO()
    monkeypatch.setattr("sys.stderr", pipe)
    monkeypatch.setattr("sys.__stderr__", pipe)
    return pipe


def test_a_pipe_hears_of_a_step_without_news_once(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = open_pipe(monkeypatch, 0.01)
    with Progress() as progress:
        for step in ("load", "solve"):
            progress(step)
            time.sleep(0.3)
    assert [line.split()[1] for line in pipe.getvalue().splitlines()] == ["load", "solve"]


@pytest.mark.parametrize(("patience", "words"), [(0.05, True), (60.0, False)])
def test_a_pipe_gets_lines_with_percentage_and_time_left(monkeypatch, patience: float, words: bool) -> None:
    pipe = open_pipe(monkeypatch, patience)
    with Progress() as progress:
        progress("first step")
        advance(0.25)
        time.sleep(0.35)
    lines = pipe.getvalue().splitlines()
    assert bool(lines) is words
    assert len(lines) <= 4
    assert all(line.startswith("flexlin: 25 %, ") and line.endswith(": first step") for line in lines)


def test_the_time_left_is_that_of_the_rest_and_never_counts_up() -> None:
    """Work that stands still, or is slower than it was, takes longer than was thought: no time is shown until less is left."""
    progress, lines = Progress(), []
    progress("step")
    done = ((30, 0.0), (10, 0.5), (12, 0.5), (25, 0.5), (25, 0.6), (40, 0.9), (80, 0.91), (80, 0.1), (80, 0.99))
    for elapsed, share in done:  # what was done once stays done
        progress._start = time.perf_counter() - elapsed
        progress._advance(share)
        lines.append(progress.line)
    assert lines == [
        "step (30 s so far)", "50 %, about 10 s left: step", "50 %, about 10 s left: step", "50 %, 25 s so far: step",
        "60 %, 25 s so far: step", "90 %, about 4 s left: step", "91 %, 80 s so far: step", "91 %, 80 s so far: step",
        "99 %, about 1 s left: step",
    ]  # fmt: skip


def test_stages_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", logger="flexlin"):
        Clock().stage("a stage", Accuracy(), lambda: None)
    assert [record.getMessage().partition(":")[0] for record in caplog.records] == ["a stage"]
