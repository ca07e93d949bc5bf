"""How much of the work is done: a calculation says so wherever it knows, and whoever listens shows it.

Nobody has to listen, and no calculation depends on it: without a listener a call is a look at one variable.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Listener = Callable[[float], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def advance(share: float) -> None:
    """Say that this share, from 0 to 1, of the work at hand is done."""
    listener = _listener.get()
    if listener is not None:
        listener(share)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Hand every share that the block says to a listener."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


@contextmanager
def part(low: float, high: float) -> Iterator[None]:
    """The block is the part from `low` to `high` of the work outside: what it says from 0 to 1 is said of the whole."""
    outside = _listener.get()
    if outside is None:
        yield
        return
    outside(low)
    with listening(lambda share: outside(low + (high - low) * min(max(share, 0.0), 1.0))):
        yield
    outside(high)
