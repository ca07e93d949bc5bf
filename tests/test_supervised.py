"""Work that ends without a word, cannot be interrupted, or eats memory inside a library: its parent says so and ends it."""

import contextlib
import ctypes
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexlin.cli import ended_by_signal, pass_over, read_limit

WORK = (
    "import os, sys, time, signal\n"
    "from flexlin.cli.program import run_to_its_end\n"
    "from flexlin.cli.supervised import Channel, is_supervised, send_written\n"
    "from pathlib import Path\n"
    "assert is_supervised()\n"
    "def limit(seconds, memory): Channel.send('limits', time.perf_counter() + seconds, seconds, memory)\n"
)
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="work is supervised on Linux")


def start(work: str, *words: str) -> "subprocess.Popen[str]":
    """A program that does the work under supervision, called with these words."""
    code = f"{WORK}\ndef work():\n    {work}\n    return 0\nsys.exit(run_to_its_end(work))"
    command = f"sys.exit(supervise([sys.executable, '-c', {code!r}, *{words!r}]))"
    return begin("-c", f"import sys\nfrom flexlin.cli.supervised import supervise\n{command}")


def begin(*words: str, **options: Any) -> "subprocess.Popen[str]":
    """Python with these words, whose output is read."""
    place, pipes = Path(__file__).parents[1], {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([sys.executable, *words], text=True, cwd=place, **pipes, **options)


ENDS = {
    "all is said": ("print('done')", 0, "done\n", ""),
    "an exit code of its own": ("sys.exit(3)", 3, "", ""),
    "something is left for the end": ("import atexit; atexit.register(print, 'closed'); print('done')", 0, "done\nclosed\n", ""),
    "a thread goes on": ("from threading import Timer; Timer(0.3, print, ['late']).start()", 0, "late\n", ""),
    "clearing away goes on": (
        "import atexit; atexit.register(time.sleep, 60); limit(0.5, 1e9); print('done', flush=True)", 0, "done\n", ""),
    "abort in a library": ("os.abort()", 1, "", "(signal SIGABRT); most often there is not enough memory"),
    "exit in a library": ("os._exit(1)", 1, "", "(exit code 1); most often there is not enough memory"),
    "killed by the system": ("os.kill(os.getpid(), signal.SIGKILL)", 1, "", "(signal SIGKILL); most often"),
    "no memory for a message": (
        "import flexlin.cli.program as m; m.report_fault = lambda *a: [][0]; raise MemoryError", 1, "", "there is not enough memory"),
    "one endless call": (
        "limit(0.5, 1e9); sum(range(10**12))", 4, "",
        "with a time limit of 0.5 s: it did not end by itself in time; allow more time (--limit-seconds above 0.5,"),
    "one endless call after the numbers": (
        "send_written([Path('out/report.json')]); limit(0.5, 1e9); sum(range(10**12))", 4, "",
        "in the scene's [accuracy]); what was known before stands in out/report.json"),
    "one greedy call": (
        "limit(60, 1e6); list(range(10**9))", 2, "",
        "stopped at the limit of memory of 1,000,000 bytes, which it did not keep by itself; allow more (--limit-memory above"),
}  # fmt: skip


@pytest.mark.parametrize(("work", "code", "out", "err"), ENDS.values(), ids=ENDS.keys())
def test_however_the_work_ends_there_is_a_message(work, code, out, err):
    run = start(work)
    said = run.communicate(timeout=300)
    assert (run.returncode, said[0]) == (code, out)
    assert err in said[1] if err else said[1] == ""
    assert said[1].count("flexlin: ") <= 1


def test_a_limit_holds_before_the_work_has_sent_its_own():
    """Nothing is known of a scene while libraries are loaded, which takes long on a busy machine."""
    run = start("time.sleep(60)", "--limit-seconds", "1")
    _, said = run.communicate(timeout=300)
    assert run.returncode == 4
    assert "with a time limit of 1 s: it did not end by itself in time" in said


def test_a_limit_that_is_none_is_for_the_work_to_refuse():
    for stated in ("nan", "-1", "inf", "four", ""):
        assert read_limit(["check", "single-link", "--limit-seconds", stated]) == 0.0
    assert read_limit(["check", "single-link", "--limit-seconds=1"]) == 1.0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_request_to_end_reaches_the_work(number):
    handle = "for number in (signal.SIGTERM, signal.SIGINT): signal.signal(number, signal.default_int_handler)"
    wait = "try: print('ready', flush=True); time.sleep(60)\n    except KeyboardInterrupt: print('cleaned')"
    run = start(f"{handle}\n    {wait}")
    assert run.stdout.readline() == "ready\n"
    run.send_signal(number)
    assert run.communicate(timeout=300) == ("cleaned\n", "")
    assert run.returncode == 0


def test_a_killed_parent_takes_the_work_with_it():
    run = start("print(os.getpid(), flush=True); time.sleep(60)")
    child = int(run.stdout.readline())
    run.kill()
    run.communicate(timeout=300)
    with contextlib.suppress(ProcessLookupError):
        for _ in range(200):
            os.kill(child, 0)
            if f"{child} (python" in (status := Path(f"/proc/{child}/stat").read_text()) and ") Z " in status:
                break
            time.sleep(0.05)
        else:
            pytest.fail("the work went on alone")


def test_an_error_in_a_destructor_is_one_line(capsys):
    """Python can raise nothing there; the default is to print a traceback and go on. After an interruption it is no news."""
    odd = SimpleNamespace(exc_type=ValueError, exc_value=ValueError("odd"))
    with contextlib.suppress(KeyboardInterrupt), ended_by_signal():
        pass_over(odd)
        assert capsys.readouterr().err == "flexlin: note: ValueError where nothing can be raised: odd\n"
        Struck().shape  # noqa: B018
    pass_over(odd)
    assert capsys.readouterr().err == ""


class Struck:
    """Ctrl-C strikes while a library looks whether this has an attribute, as CasADi does before it adds two things."""

    def __getattr__(self, name: str) -> object:
        os.kill(os.getpid(), signal.SIGINT)
        return time.sleep(30)


def drop_in_a_destructor() -> None:
    pass_over(SimpleNamespace(exc_type=KeyboardInterrupt, exc_value=KeyboardInterrupt()))


def drop_in_a_library() -> None:
    has = ctypes.pythonapi.PyObject_HasAttrString
    has.argtypes = (ctypes.py_object, ctypes.c_char_p)
    assert has(Struck(), b"shape") == 0


def make_another_error() -> None:
    try:
        Struck().shape  # noqa: B018
    except KeyboardInterrupt:
        raise RuntimeError("KeyboardInterrupt") from None


@pytest.mark.parametrize("lose", [drop_in_a_destructor, drop_in_a_library, make_another_error])
def test_ctrl_c_that_a_library_drops_comes_again(lose, monkeypatch):
    monkeypatch.setattr("flexlin.cli.program.SIGNAL_SECONDS", 0.1)

    def work() -> None:
        with ended_by_signal():
            lose()
            time.sleep(30)

    with pytest.raises(KeyboardInterrupt):
        work()
    time.sleep(0.3)  # nothing strikes once the work is over


@pytest.mark.parametrize("space", [60e6, 430e6])
def test_little_memory_from_the_start_ends_in_one_message(space):
    """Libraries that cannot even be loaded: some raise, some end the process, OpenBLAS waits for ever."""
    from resource import RLIMIT_AS, setrlimit

    words = "-m", "flexlin", "check", "single-link", "--limit-seconds", "8"
    run = begin(*words, preexec_fn=lambda: setrlimit(RLIMIT_AS, (int(space), int(space))))
    _, said = run.communicate(timeout=300)
    assert run.returncode == 2
    assert "address space" in said
    assert not re.search("Traceback|fault of flexlin", said)


@pytest.mark.slow
@pytest.mark.parametrize(("words", "closed", "code"), [("list", 1, 0), ("show no-such-scene", 2, 2)])
def test_a_stream_that_is_closed_stops_nothing(words, closed, code):
    run = begin("-m", "flexlin", *words.split(), preexec_fn=lambda: os.close(closed))
    assert (*run.communicate(timeout=300), run.returncode) == ("", "", code)


@pytest.mark.slow
def test_an_interrupt_inside_compiled_code_ends_a_chart_with_what_is_known(tmp_path):
    """Ctrl-C while threads are inside the compiled kernel: whole files, or none, and a message; no thread and no trace is left."""
    over = ["effects.payload.mass=0:0.3:600", "motion.frequency=0.1:1:600"]
    run = begin("-m", "flexlin", "chart", "single-link", "--over", *over, "--out", str(tmp_path))
    time.sleep(2.5)
    run.send_signal(signal.SIGINT)
    _, said = run.communicate(timeout=300)
    assert run.returncode in (1, 4), said
    assert "interrupted" in said
    assert not re.search("Traceback|fault", said)
    if run.returncode == 4:
        with np.load(tmp_path / "chart.npz", allow_pickle=False) as found:
            assert 0 < np.isfinite(found["error"]).sum() < found["error"].size
    else:
        assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("wait", [0.02, 0.1, 0.4])
def test_an_interrupt_while_the_program_is_loaded_leaves_no_trace(wait):
    """Whether a request to end strikes the program, or Ctrl-C the program and its work, as in a terminal."""
    begins = "lambda event, of: event == 'import' and of[0] == 'flexlin.cli.program' and print('begun', flush=True)"
    code = f"import sys, flexlin.__main__ as program; sys.addaudithook({begins}); program.main()"
    word = "flexlin: interrupted; no file was left half-written"  # by the program, its work, or both at once
    for kill, number in ((os.killpg, signal.SIGINT), (os.kill, signal.SIGTERM)):
        run = begin("-c", code, "check", "single-link", start_new_session=True)
        assert run.stdout.readline() == "begun\n"
        time.sleep(wait)
        kill(run.pid, number)
        out, said = run.communicate(timeout=300)
        assert run.returncode in (0, 1), out
        left = [line for line in said.replace(word, "").split("\n") if line and not line.endswith(" so far)")]
        assert (left, word in said) == ([], run.returncode == 1)


def test_the_parent_of_the_work_loads_no_library():
    code = "import flexlin.cli.program, sys; print(sorted({'pydantic', 'pydantic_core', 'numpy', 'casadi', 'scipy'} & set(sys.modules)))"
    assert begin("-c", code).communicate(timeout=300) == ("[]\n", "")
