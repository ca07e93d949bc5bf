"""What few workers need: it travels as bytes, and is unpacked, with the libraries it asks for, where somebody asks for it."""

import pickle
from typing import Generic, TypeVar

T = TypeVar("T")


class Later(Generic[T]):
    """A value, or its pickle until it is first asked for."""

    def __init__(self, value: T):
        self._value, self._pickled = value, b""

    @property
    def value(self) -> T:
        """The value itself."""
        if self._pickled:
            self._value, self._pickled = pickle.loads(self._pickled), b""
        return self._value

    def __reduce__(self) -> tuple[object, ...]:
        return unpack, (self._pickled or pickle.dumps(self._value, protocol=pickle.HIGHEST_PROTOCOL),)


def unpack(pickled: bytes) -> "Later[object]":
    """What travelled, still packed."""
    later = Later[object](None)
    later._pickled = pickled
    return later
