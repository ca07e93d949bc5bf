"""What public functions and results have in common: arguments of other kinds are refused by name, and a repr of a few lines says what a
result is; attributes are computed when they are first read, once, pickled, and while no thread holds up the others."""

import inspect
import pickle
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike

import flexlin as fl
from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.summary import represent
from tests.public_results import public_results

NO_NUMBERS = [None, "1", True, np.True_, [1.0], np.ones(1), 1j, b"1"]
KINDS: dict[Any, tuple[list[Any], list[Any]]] = {
    float: ([1, 2.5, np.float32(1), np.int64(3), np.array(2.0), np.nan], NO_NUMBERS),
    int: ([1, np.int64(3), -5], [1.0, "1", True, None, np.float64(2)]),
    str: (["", "a"], [None, 1, b"a", ["a"]]),
    bool: ([False, np.True_], [0, 1, "yes", None, np.ones(1)]),
    Literal["a", "b"]: (["a", "b"], ["c", None, 1, ["a"]]),
    str | Path | None: (["a", Path("a"), None], [1, b"a", ["a"], True]),
    ArrayLike: ([1, [1, 2], [[1.0], [2.0]], np.eye(2), 1j], ["a", None, {}, [[1, 2], [3]], object()]),
    Array | None: ([np.eye(2), None], ["a", {}]),
    Callable[[Array], Array] | ArrayLike | None: ([np.sin, lambda: 1, [1.0], None], ["a", {}, [["a"]]]),
    Mapping[str, Any] | None: ([{}, {"a": 1}, None], [[], "a", 1]),
    Sequence[str]: ([["a"], ("a", "b"), []], ["ab", [1], 3, {"a": 1}, None]),
    Sequence[tuple[float, float]]: ([[(0.1, 0.2)], [[1, 2]], np.eye(2)], [[1, 2], [(1, 2, 3)], [("a", "b")], "ab"]),
    Iterable[int]: ([[1], range(3), {1, 2}, iter([1])], ["12", [1.5], 3]),
    Any: ([object()], []),
}
"""Of each annotation what passes and what does not."""


def taking(kind: Any) -> Callable[..., str]:
    """A function of one argument of this kind."""

    def function(value):
        return "done"

    function.__annotations__["value"] = kind
    return checked(function)


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_what_is_asked_for_passes_and_what_is_not_is_refused_by_name(kind):
    good, bad = KINDS[kind]
    for value in good:
        assert taking(kind)(value) == taking(kind)(value=value) == "done"
    for value in bad:
        with pytest.raises(fl.errors.ArgumentError, match=r"^value is of another kind; got .*, expected "):
            taking(kind)(value)


def test_a_value_without_a_repr_is_refused_too_and_calls_that_do_not_fit_are_python_s_own_matter():
    class Hostile:
        def __repr__(self) -> str:
            raise RuntimeError

    with pytest.raises(fl.errors.ArgumentError, match="got a Hostile, expected a number"):
        taking(float)(Hostile())
    with pytest.raises(TypeError, match="unexpected keyword"):
        taking(float)(nonsense=1)
    assert taking(float).__name__ == "function"


@pytest.mark.parametrize("module", [fl, fl.control])
def test_every_public_function_refuses_other_kinds_by_name(module):
    """The norms, `tune` and `scene_from_urdf` did not: errors of Python's and NumPy's own came through."""
    functions = [one for name in module.__all__ if inspect.isfunction(one := getattr(module, name))]
    taking = [one for one in functions if inspect.signature(one).parameters]
    assert [one.__name__ for one in taking if not hasattr(one, "__wrapped__")] == []


def test_a_message_about_a_kind_is_one_line_with_the_right_article():
    words = r"^s is of another kind; got array\(\[\[1., 0.\], \[0., 1.\]\]\), expected an SX;"
    with pytest.raises(fl.errors.ArgumentError, match=words):
        fl.Manipulator.from_lagrangian(np.eye(2), None, None, None)


pytestmark = pytest.mark.xdist_group("public results")


@dataclass(frozen=True)
class Sample:
    """A dataclass with every kind of field."""

    value: object
    other: object = None
    hidden: object = field(default="secret", repr=False)

    __repr__ = represent


SHOWN = [
    (True, "True"),
    (np.float64(1 / 3), "0.333333"),
    ("x" * 200, repr("x" * 77 + "...")),
    (np.arange(3.0) / 3, "[0, 0.333333, 0.666667]"),
    (np.array(2.5), "2.5"),
    (np.zeros((2, 3)), "<float64 (2, 3)>"),
    (np.array(["a"]), "<<U1 (1,)>"),
    ((1, 2.5, "a"), "(1, 2.5, 'a')"),
    ((), "()"),
    ({}, "{}"),
    ({"a": 1}, "<1 int>"),
    ((Sample(1), 2.0), "<2 Sample or float>"),
    (Sample(1), "<Sample>"),
    (float, "<class float>"),
]


@pytest.mark.parametrize(("value", "shown"), SHOWN)
def test_each_kind_of_field(value, shown):
    assert repr(Sample(value)) == f"Sample(value={shown}, other=None)"


def test_long_ones_are_wrapped_and_cut():
    lines = repr(Sample("a" * 100, "b" * 100)).split("\n")
    assert (lines[0], lines[-1]) == ("Sample(", ")")
    assert max(map(len, lines)) <= 120
    wide = type("Wide", (), {"__annotations__": {f"name_{i}": float for i in range(200)}})
    lines = represent(dataclass(wide)(*np.arange(200.0) / 7)).split("\n")
    assert len(lines) == 12
    assert lines[-2].strip() == "..."


@pytest.mark.slow
def test_the_results_of_every_public_function():
    results = public_results()
    assert len(results) > 35
    for value in results.values():
        name = type(value).__name__
        if type(value).__module__.startswith("flexlin") and name != "FloquetModes":
            text = repr(value)
            assert text.count("\n") < 12, text
            assert len(text) < 2000
            assert name in text


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
