"""Attributes that are computed when they are first read: once, pickled with the object, and by no lock that a forked process inherits."""

import os
import pickle
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pytest

import flexlin as fl
from flexlin.lazy import lazy

CHILDREN, PATIENCE = 12, 30.0
"""Processes that are forked, and the seconds that each may take for an answer of milliseconds."""


@dataclass(frozen=True)
class Squared:
    """A number that knows how often it was squared."""

    value: float
    calls: tuple[list[int], ...] = ([],)

    @lazy
    def square(self) -> float:
        """The square."""
        self.calls[0].append(1)
        return self.value**2


def test_it_is_computed_once_and_pickles_with_the_object():
    one = Squared(3.0, ([],))
    assert "square" not in vars(one)
    assert (one.square, one.square) == (9.0, 9.0)
    again = pickle.loads(pickle.dumps(one))
    assert again.square == 9.0
    assert len(one.calls[0]) == len(again.calls[0]) == 1
    assert Squared.square.__doc__ == "The square."


def test_threads_get_the_same_object():
    gate = threading.Barrier(4)

    class Slow:
        @lazy
        def made(self) -> object:
            gate.wait(PATIENCE)  # all compute at the same time: none holds the others up
            return object()

    slow = Slow()
    with ThreadPoolExecutor(4) as pool:
        got = list(pool.map(lambda _: slow.made, range(4)))
    assert len(set(map(id, got))) == 1


def answer_in_a_child() -> int:
    """Fork a process that asks for exponents, which reads lazy attributes of the same classes: its id."""
    pid = os.fork()
    if pid == 0:
        try:
            os._exit(0 if fl.floquet(waving(0.7)).verdict == "stable" else 1)
        finally:
            os._exit(2)
    return pid


def waving(depth: float) -> fl.PeriodicSystem:
    """A damped oscillator whose stiffness waves; evaluated slowly, so that a fork most often falls into it."""

    def A(t):
        time.sleep(2e-3)
        values = np.zeros((len(t), 2, 2))
        values[:, 0, 1], values[:, 1, 0], values[:, 1, 1] = 1.0, -1.0 - 0.3 * depth * np.cos(2 * t), -0.4
        return values

    return fl.PeriodicSystem(A, np.pi)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork.*:DeprecationWarning")
def test_no_process_hangs_that_is_forked_while_threads_compute():
    assert fl.floquet(waving(0.5)).verdict == "stable"  # all is imported
    over = threading.Event()

    def work():
        while not over.is_set():
            _ = waving(0.5).resolved

    with ThreadPoolExecutor(3) as pool:
        for _ in range(3):
            pool.submit(work)
        try:
            for _ in range(CHILDREN):
                pid, end = answer_in_a_child(), time.monotonic() + PATIENCE
                while (done := os.waitpid(pid, os.WNOHANG))[0] == 0 and time.monotonic() < end:
                    time.sleep(1e-3)
                if done[0] == 0:
                    os.kill(pid, signal.SIGKILL)
                    os.waitpid(pid, 0)
                assert done == (pid, 0)
        finally:
            over.set()
