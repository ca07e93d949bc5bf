"""Limits of time and memory: what they stop, what they leave alone, that nothing of them stays behind."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexlin.analyses import Clock, limited, time_limit
from flexlin.analyses.clock import Allowance
from flexlin.bounds import MEMORY_LIMIT
from flexlin.checks import check_size, memory_limit
from flexlin.errors import ArgumentError, NumericalError, TimeLimit, TooLarge
from flexlin.resources import Stopwatch, read_processor, read_resident
from flexlin.scene import Accuracy


def spin(seconds: float) -> None:
    """So many seconds of the processor, which only an alarm ends early."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        np.linalg.eigvals(np.eye(8))


def test_waiting_for_other_programs_is_not_counted_but_ends_with_the_clock():
    allowed = Allowance(0.2, 1e12, 60.0, 1e12, 60.0, clock=0.6)
    begun = time.monotonic()
    with pytest.raises(TimeLimit, match=r"no answer in 0\.6 s by the clock"), limited("the stage", allowed):
        time.sleep(20.0)
    assert time.monotonic() - begun > 0.5
    with pytest.raises(TimeLimit, match=r"no answer in 0\.1 s by the clock"), time_limit("one of its trials", 0.1):
        time.sleep(20.0)


def test_the_time_of_workers_counts_while_they_work():
    before = read_processor()
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as worker:
        end = time.monotonic() + 20.0
        while read_processor() < before + 0.1 and time.monotonic() < end:
            time.sleep(0.02)
        found = read_processor()
        worker.kill()
    assert found >= before + 0.1


def change_and_spin() -> None:
    """It may ring between a change of NumPy's error handling and the block that would take it back: every overflow would go unsaid."""
    np.seterr(all="ignore")
    spin(20.0)


def wrap() -> None:
    """A calculation that takes the alarm for a failed attempt, and hands the next one on as an error of its own."""
    with suppress(NumericalError):
        spin(20.0)
    try:
        spin(20.0)
    except TimeLimit:
        raise RuntimeError("interrupted") from None


@pytest.mark.parametrize("work", [change_and_spin, wrap])
def test_whatever_a_calculation_does_with_the_alarm_it_is_the_time_limit_and_nothing_stays(work):
    before, said = (np.geterr(), signal.getsignal(signal.SIGALRM)), "the stage: stopped at the time limit"
    with pytest.raises(TimeLimit, match=rf"{said}; got no answer in 0\.1 s"), time_limit("the stage", 0.1):
        work()
    assert (np.geterr(), signal.getsignal(signal.SIGALRM)) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    with pytest.raises(RuntimeError, match="its own"), time_limit("the stage", 60.0):
        raise RuntimeError("its own")


class Finalized(SimpleNamespace):
    """Does something when it is thrown away."""

    def __del__(self) -> None:
        self.finish()


def test_an_alarm_within_a_finalizer_is_not_printed_and_rings_again(monkeypatch):
    """Python drops an error that leaves a finalizer or a garbage collector's callback and prints a note on it."""
    printed, finished = list[Any](), list[float]()
    monkeypatch.setattr(sys, "unraisablehook", printed.append)

    def drops() -> None:
        Finalized(finish=lambda: (spin(1.0), finished.append(1.0)))
        spin(20.0)

    with pytest.raises(TimeLimit), time_limit("the stage", 0.1):
        drops()
    assert finished == printed == []
    with time_limit("the stage", 60.0):
        Finalized(finish=raising(ValueError("its own")))
    assert [type(note.exc_value) for note in printed] == [ValueError]
    assert sys.unraisablehook == printed.append


SPINNING = "import time\nend = time.process_time() + 0.6\nwhile time.process_time() < end: pass\n"
LIMITED = "from flexlin.analyses import time_limit\nwith time_limit('the study', 0.1):\n    while True: pass\n"


def test_an_alarm_amid_an_import_waits_until_the_module_is_whole(tmp_path, monkeypatch):
    """A package whose parts are only half there stays in sys.modules, and the next import of it takes them for whole."""
    (tmp_path / "slow_package").mkdir()
    both = "from slow_package import first\nfrom slow_package import second\n"
    for name, text in (("__init__", both), ("first", SPINNING), ("second", "value = 2\n"), ("../study", LIMITED)):
        (tmp_path / "slow_package" / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))

    def load_and_spin() -> None:
        import_module("slow_package")
        spin(20.0)

    with pytest.raises(TimeLimit), time_limit("the stage", 0.1):
        load_and_spin()
    assert sys.modules.pop("slow_package").second.value == 2
    with pytest.raises(TimeLimit, match="the study"):
        import_module("study")


@pytest.mark.slow
def test_a_block_that_takes_too_much_memory_is_ended():
    """What nobody has predicted is noticed on the way."""
    taken: list[np.ndarray] = []

    def greedy() -> None:
        for _ in range(4000):
            taken.append(np.ones(2**17))
            time.sleep(0.001)

    said = r"the table: stopped at the limit of memory; got [\d,]+ bytes, expected at most 50,000,000 bytes"
    with pytest.raises(TooLarge, match=said), time_limit("the table", 60.0, 5e7):
        greedy()
    assert len(taken) < 4000
    with time_limit("the table", 60.0, 5e7):
        spin(0.5)
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.slow
def test_a_limit_around_another_one_holds_within_it_and_after_it():
    def part_and_rest() -> None:
        with time_limit("a part", 60.0):
            spin(0.01)
        spin(20.0)

    with pytest.raises(TimeLimit, match="the whole"), time_limit("the whole", 0.3):
        part_and_rest()
    with pytest.raises(TimeLimit, match="the whole"), time_limit("the whole", 0.1), time_limit("a part", 60.0):
        spin(20.0)
    with time_limit("the whole", 60.0):
        for _ in range(3):
            with pytest.raises(TimeLimit, match="a part"), time_limit("a part", 0.1):
                spin(20.0)
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("again", [0.0, 0.05])
def test_an_alarm_of_before_and_a_hook_put_in_the_block_go_on(again, monkeypatch):
    """Rung once, or again and again."""
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    rung: list[int] = []
    handler = signal.signal(signal.SIGALRM, lambda number, _: rung.append(number))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3, again)
        with time_limit("the stage", 60.0):
            sys.unraisablehook = report = lambda _: None
            spin(0.05)
        assert sys.unraisablehook is report
        assert 0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 0.3
        spin(0.6)
        assert len(rung) > 1 if again else rung == [signal.SIGALRM]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)


def test_another_thread_is_let_run():
    done: list[float] = []

    def work() -> None:
        with time_limit("the stage", 0.01):
            spin(0.1)
            done.append(1.0)

    with ThreadPoolExecutor(1) as pool:
        pool.submit(work).result()
    assert done == [1.0]


def test_the_limit_of_memory_holds_within_its_block():
    with memory_limit(1000):
        check_size("a table", 1000, "less")
        with pytest.raises(TooLarge, match="1,001 bytes, expected at most 1,000 bytes"):
            check_size("a table", 1001, "less")
    check_size("a table", MEMORY_LIMIT, "less")
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(ArgumentError), memory_limit(wrong):
            pass


def test_memory_and_linear_algebra_that_give_out_are_the_stage_s_message():
    clock = Clock(Accuracy())
    singular, full = partial(np.linalg.inv, np.zeros((2, 2))), raising(MemoryError("cannot allocate 3 TiB"))
    answers, problems = zip(clock.attempt("inverse", singular), clock.attempt("table", full), strict=True)
    assert (answers, problems) == ((None, None), tuple(step.problem for step in clock.steps))
    assert "inverse: linear algebra has no answer; got Singular matrix" in problems[0]
    assert "table: there is not enough memory; got cannot allocate 3 TiB" in problems[1]
    assert clock.failures["inverse"].__traceback__ is None
    with pytest.raises(ZeroDivisionError), limited("a fault", clock.allow("a fault")):
        raise ZeroDivisionError


def raising(error: BaseException) -> Callable[..., None]:
    """Work that ends in this error."""

    def work(*_: object, **__: object) -> None:
        raise error

    return work


@pytest.mark.parametrize("words", ["std::bad_alloc", "x.so: failed to map segment", "can't start new thread"])
def test_memory_that_gives_out_inside_a_library_is_named(words):
    with pytest.raises(NumericalError, match="map: there is not enough memory"):
        Clock(Accuracy()).stage("map", raising(RuntimeError(f"/casadi/core/function.cpp:56: {words}")))
    with pytest.raises(RuntimeError, match="other"):
        Clock(Accuracy()).stage("map", raising(RuntimeError("other")))


def test_the_stages_share_one_limit_and_the_last_one_gets_what_was_kept_for_it():
    """Each attempt gets two thirds of what is left, the last stage the kept rest; nothing begins beyond the end."""
    asked, now = Accuracy(seconds=60.0), Stopwatch()

    def spent(seconds: float, waited: float = 0.0) -> Clock:
        """After so many seconds of work, and of waiting for other programs."""
        watch = Stopwatch(now.begun - seconds - waited)
        watch.worked -= seconds
        return Clock(asked, watch=watch)

    waiting = spent(8.0, 30.0)
    for found, expected in (
        (Clock(asked, watch=now).allow("one", share=2 / 3).seconds, 32.0),
        (spent(47.0).allow("one").seconds, 1.0),
        (spent(52.0).allow("figures", last=True).seconds, 8.0),
        (waiting.allow("one").seconds, 40.0),
        (waiting.allow("one").clock, 10.0),
        (waiting.plan(), 9.0),
        (Clock(Accuracy(), watch=waiting.watch).allow("one").clock, 106.0),
    ):
        assert found == pytest.approx(expected, abs=0.9)
    said = r"one: not begun; got 48 of 60 s are used up; .*writing; allow more time \(--limit-seconds above 60"
    with pytest.raises(TimeLimit, match=said):
        spent(52.0).allow("one")
    held = Clock(asked, watch=now, held=read_resident() - 2**20)
    assert held.allow("one").memory == pytest.approx(asked.memory - 2**20, abs=2**22)
    ends = [(one.stages_end, one.last_end) for one in (Accuracy(seconds=s) for s in (60.0, 3600.0, 2.0))]
    assert ends == [(48.0, 60.0), (3570.0, 3600.0), (1.6, 3.1)]


@pytest.mark.slow
def test_what_is_advised_helps():
    """A proof gets a share of the whole: more seconds let it end, as its message says; it names no tol, which would not."""
    for seconds, proved in ((60.0, None), (1200.0, "proved")):
        clock = Clock(Accuracy(seconds=seconds))
        found, problem = clock.attempt("proof", lambda: spin(0.5) or "proved", at_most=0.2)
        assert found == proved
        said = "no answer in 0.2 s of the 60 s of the whole; allow more time (--limit-seconds above 60"
        assert (said in problem) is (proved is None)
    with pytest.raises(TimeLimit, match="ask for a larger tol, or allow more time"):
        Clock(Accuracy(seconds=0.2)).stage("exponents", lambda: spin(60.0), lambda _: 0.0)
