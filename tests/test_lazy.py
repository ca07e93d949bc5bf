"""Attributes that are computed when they are first read: once, pickled with the object, and while no thread holds up the others."""

import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from flexlin.lazy import lazy

PATIENCE = 30.0
"""Seconds that threads may wait for each other."""


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
