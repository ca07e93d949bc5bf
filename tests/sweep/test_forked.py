"""Workers that are copies of this process: they answer, notice their parent's end, and give way to an interpreter when not well."""

import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from flexlin.answers.sweep import forked
from flexlin.answers.sweep.processes import Worker
from flexlin.answers.sweep.worker import answer, receive, send

pytestmark = pytest.mark.skipif(not forked.can_copy(), reason="processes are copied on Linux only")


class Doubling:
    """Work that says who did it."""

    def compute(self, points):
        if points is None:
            raise ValueError("nothing to double")
        return os.getpid(), 2 * points


def test_copies_answer_and_leave_nothing_behind():
    copies = []
    for _ in range(3):
        copies.append(
            forked.Copy(partial(answer, Doubling()), [end for one in copies for end in (one.stdin, one.stdout)])
        )
    points = np.random.default_rng(0).normal(size=(7, 2))
    for one in reversed(copies):
        assert one.is_well()
        send(one.stdin, points)
        pid, doubled = receive(one.stdout)
        assert pid == one.pid != os.getpid()
        assert np.array_equal(doubled, 2 * points)
        send(one.stdin, None)
        assert "nothing to double" in str(receive(one.stdout))
    copies[0].stdin.close()  # the others do not hold it open
    copies[0].wait()
    for one in copies[1:]:
        one.kill()
        one.wait()
    for one in copies:
        one.stdin.close()
        one.stdout.close()
        with pytest.raises(ChildProcessError):
            os.waitpid(one.pid, os.WNOHANG)


def test_a_copy_that_is_not_well_is_replaced(monkeypatch):
    monkeypatch.setattr(forked, "PATIENCE", 0.05)
    monkeypatch.setattr(forked, "live_as_copy", lambda *_: time.sleep(60) or os._exit(0))
    worker, started = Worker(Doubling(), b""), []
    worker.copy([])
    stuck = worker._process.pid
    monkeypatch.setattr("flexlin.answers.sweep.processes.subprocess.Popen", lambda *_, **__: started.append(1) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        worker.compute(np.zeros((1, 1)))
    assert started
    with pytest.raises(ChildProcessError):
        os.waitpid(stuck, os.WNOHANG)


@pytest.mark.slow
def test_copies_end_with_their_parent():
    script = (
        "import os, sys, time, functools\n"
        "from flexlin.answers.sweep.forked import Copy; from flexlin.answers.sweep.worker import answer\n"
        "a = Copy(functools.partial(answer, None), []); b = Copy(functools.partial(answer, None), [a.stdin, a.stdout])\n"
        "assert a.is_well() and b.is_well()\n"
        "print(a.pid, b.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False
    )
    pids = [int(word) for word in done.stdout.split()]
    assert len(pids) == 2, done.stderr
    for _ in range(100):
        left = [pid for pid in pids if is_running(pid)]
        if not left:
            return
        time.sleep(0.05)
    raise AssertionError(left)


def is_running(pid):
    """Whether a process is there and has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
