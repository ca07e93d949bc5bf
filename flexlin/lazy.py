"""What is done when it is first asked for: public names that are loaded, attributes that are computed."""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any, Generic, TypeVar, overload

Value = TypeVar("Value")


def load_lazily(
    package: str, promised: Mapping[str, str], within: Mapping[str, str] | None = None, whole: Sequence[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """The `__getattr__`, `__dir__` and `__all__` (PEP 562) of a package: its door, by the modules of flexlin that the names stand in.

    What is promised to users is listed; other rooms and tests also ask for what is given `within` flexlin, and need not know the file.
    Modules that are promised as a `whole` are named themselves.
    """
    tables = [
        {name: place for place, given in table.items() for name in given.split()} for table in (promised, within or {})
    ]
    modules = {place.rpartition(".")[2]: place for place in whole}
    places, names = tables[0] | tables[1], sorted([*tables[0], *modules])

    def load(name: str) -> Any:
        if name in modules:
            return import_module(f"flexlin.{modules[name]}")
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"flexlin.{places[name]}"), name)

    return load, lambda: names, names


class lazy(Generic[Value]):  # noqa: N801 - read as a word before a method, like property
    """A method without arguments that becomes an attribute when it is first read.

    Unlike `functools.cached_property` of Python 3.11 it holds no lock while it computes: a process that is forked meanwhile would
    inherit the lock, held by a thread that it does not have, and wait for ever. Threads that come at the same time compute it each, and
    all get the first one's value. Like that one it stands in the instance's `__dict__`, so it pickles with the instance.
    """

    def __init__(self, compute: Callable[[Any], Value]):
        self.compute, self.name = compute, compute.__name__
        self.__doc__ = compute.__doc__

    @overload
    def __get__(self, instance: None, owner: type) -> "lazy[Value]": ...
    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Value: ...
    def __get__(self, instance: object | None, owner: type | None = None) -> "lazy[Value] | Value":
        if instance is None:
            return self
        value: Value = instance.__dict__.setdefault(self.name, self.compute(instance))
        return value
