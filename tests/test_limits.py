"""Limits of time and memory: what they stop, what they leave alone, and that nothing of them stays behind."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from flexlin.answers.clock import Clock
from flexlin.answers.limits import limited, time_limit
from flexlin.checks import LIMIT, check_size, memory_limit
from flexlin.cli.main import main
from flexlin.errors import ArgumentError, NumericalError, TimeLimit, TooLarge
from flexlin.scene.accuracy import Accuracy


def spin(seconds: float) -> None:
    """Work that only an alarm ends early."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        np.linalg.eigvals(np.eye(8))


def test_a_block_beyond_its_time_is_ended_and_the_alarm_is_gone() -> None:
    before, start = signal.getsignal(signal.SIGALRM), time.monotonic()
    with (
        pytest.raises(TimeLimit, match=r"the stage: stopped at the time limit; got no answer in 0\.1 s"),
        time_limit("the stage", 0.1),
    ):
        spin(20.0)
    assert time.monotonic() - start < 10.0
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_calculation_that_takes_the_alarm_for_a_failed_attempt_is_ended_too() -> None:
    def tries_twice() -> None:
        with suppress(NumericalError):
            spin(20.0)
        spin(20.0)

    with pytest.raises(TimeLimit), time_limit("the stage", 0.1):
        tries_twice()


def test_an_alarm_that_compiled_code_hands_on_as_its_own_error_is_the_time_limit() -> None:
    def wraps() -> None:
        try:
            spin(20.0)
        except TimeLimit:
            raise RuntimeError("interrupted") from None

    with pytest.raises(TimeLimit), time_limit("the stage", 0.1):
        wraps()
    with pytest.raises(RuntimeError, match="its own"), time_limit("the stage", 60.0):
        raise RuntimeError("its own")


def test_a_block_that_takes_too_much_memory_is_ended() -> None:
    """What nobody has predicted is noticed on the way."""
    taken: list[np.ndarray] = []

    def greedy() -> None:
        for _ in range(4000):
            taken.append(np.ones(2**17))
            time.sleep(0.001)

    with (
        pytest.raises(
            TooLarge, match=r"the table: stopped at the limit of memory; got \d+ bytes, expected at most 50000000 bytes"
        ),
        time_limit("the table", 60.0, 5e7),
    ):
        greedy()
    assert len(taken) < 4000
    with time_limit("the table", 60.0, 5e7):
        spin(0.5)
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_alarm_of_before_rings_in_its_time() -> None:
    rung: list[int] = []
    handler = signal.signal(signal.SIGALRM, lambda number, _: rung.append(number))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        with time_limit("the stage", 60.0):
            spin(0.05)
        assert 0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 0.3
        spin(1.0)
        assert rung == [signal.SIGALRM]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)


def test_another_thread_is_let_run() -> None:
    done: list[float] = []

    def work() -> None:
        with time_limit("the stage", 0.01):
            spin(0.1)
            done.append(1.0)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [1.0]


def test_the_limit_of_memory_holds_within_its_block() -> None:
    with memory_limit(1000):
        check_size("a table", 1000, "less")
        with pytest.raises(TooLarge, match="1001 bytes, expected at most 1000 bytes"):
            check_size("a table", 1001, "less")
    check_size("a table", LIMIT, "less")
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(ArgumentError), memory_limit(wrong):
            pass


def test_memory_and_linear_algebra_that_give_out_are_the_stage_s_message() -> None:
    clock, problems = Clock(), dict[str, str]()

    def singular() -> None:
        np.linalg.inv(np.zeros((2, 2)))

    def greedy() -> None:
        raise MemoryError("cannot allocate 3 TiB")

    assert clock.attempt(problems, "a", "inverse", Accuracy(), singular) is None
    assert clock.attempt(problems, "b", "table", Accuracy(), greedy) is None
    assert "inverse: linear algebra has no answer; got Singular matrix" in problems["a"]
    assert "table: there is not enough memory; got cannot allocate 3 TiB" in problems["b"]
    assert [step.problem for step in clock.steps] == [problems["a"], problems["b"]]
    with pytest.raises(ZeroDivisionError), limited("a fault", Accuracy()):
        raise ZeroDivisionError


@pytest.mark.parametrize("value", ["0", "-1e-9", "nan", "inf", "1e9", "1e-30"])
def test_a_tol_that_is_none_is_refused(value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "single-link", f"--tol={value}", "--out", str(tmp_path)]) == 2
    assert "accuracy.tol" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


HUGE = [
    ["simulate", "single-link", "--periods", "1e9"],
    ["linearize", "single-link", "--points", "1000000000"],
    ["design", "single-link", "--points", "1000000000"],
    ["export", "single-link", "--points", "1000000000"],
    ["chart", "single-link", "--over", "motion.frequency=0.2:3:1000000000"],
    ["chart", "single-link", "--over", "motion.frequency=0.2:3:40000", "effects.payload.mass=0:0.3:40000"],
    ["linearize", "single-link", "--points", "100000", "--limit-memory", "2e6"],
]


@pytest.mark.parametrize("arguments", HUGE, ids=lambda a: " ".join(a[::2]))
def test_a_request_that_would_not_fit_is_refused_with_the_figure(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert "is too large; got" in message
    assert "bytes, expected at most" in message
    assert list(tmp_path.iterdir()) == []


def test_a_request_to_end_the_program_acts_as_ctrl_c(tmp_path: Path) -> None:
    """SIGTERM in the middle of the work: one line, exit code 1, no file."""
    program = [sys.executable, "-m", "flexlin", "simulate", "single-link", "--periods", "3000", "--out", str(tmp_path)]
    watch = "import sys; from flexlin.cli import main; print('ready', flush=True)"
    code = f"{watch}; from flexlin.cli.main import entry; sys.argv[0] = 'flexlin'; entry()"
    run = subprocess.Popen(
        [sys.executable, "-c", code, *program[3:]], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert run.stdout is not None
    assert run.stdout.readline() == "ready\n"
    time.sleep(3.0)
    os.kill(run.pid, signal.SIGTERM)
    out, err = run.communicate(timeout=60)
    assert (out, err, run.returncode) == ("", "flexlin: interrupted; no file was left half-written\n", 1)
    assert list(tmp_path.iterdir()) == []
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
