"""Arguments of another kind are refused by name; those of the kind that is stated pass, however they are given."""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike

import flexlin as fl
from flexlin.arguments import checked
from flexlin.checks import Array


@checked
def everything(
    number: float = 1.0,
    count: int = 1,
    text: str = "",
    flag: bool = True,
    choice: Literal["a", "b"] = "a",
    path: str | Path | None = None,
    array: ArrayLike = 0.0,
    matrix: Array | None = None,
    function: Callable[[Array], Array] | ArrayLike | None = None,
    table: Mapping[str, Any] | None = None,
    names: Sequence[str] = (),
    pairs: Sequence[tuple[float, float]] = (),
    some: Iterable[int] = (),
    anything: Any = None,
    bare=None,
) -> str:
    return "done"


GOOD = {
    "number": [1, 2.5, np.float32(1), np.int64(3), np.array(2.0), float("nan")],
    "count": [1, np.int64(3), -5],
    "flag": [False, np.True_],
    "path": ["a", Path("a"), None],
    "array": [1, [1, 2], [[1.0], [2.0]], np.eye(2), 1j],
    "matrix": [np.eye(2), None],
    "function": [np.sin, lambda: 1, [1.0], None],
    "table": [{}, {"a": 1}],
    "names": [["a"], ("a", "b"), []],
    "pairs": [[(0.1, 0.2)], [[1, 2]], np.ones((2, 2))],
    "some": [[1], range(3), {1, 2}, iter([1])],
    "anything": [object()],
    "bare": [object()],
}
BAD = {
    "number": [None, "1", True, np.True_, [1.0], np.ones(1), 1j, b"1"],
    "count": [1.0, "1", True, None, np.float64(2)],
    "text": [None, 1, b"a", ["a"]],
    "flag": [0, 1, "yes", None, np.ones(1)],
    "choice": ["c", None, 1, ["a"]],
    "path": [1, b"a", ["a"], True],
    "array": ["a", None, {}, [[1, 2], [3]], object()],
    "matrix": ["a", {}],
    "function": ["a", {}, [["a"]]],
    "table": [[], "a", 1],
    "names": ["ab", [1], 3, {"a": 1}, None],
    "pairs": [[1, 2], [(1, 2, 3)], [("a", "b")], "ab"],
    "some": ["12", [1.5], 3],
}


@pytest.mark.parametrize("name", GOOD | BAD)
def test_what_is_asked_for_passes_and_what_is_not_is_refused_by_name(name):
    for value in GOOD.get(name, []):
        assert everything(**{name: value}) == "done"
    for value in BAD.get(name, []):
        with pytest.raises(fl.errors.ArgumentError, match=f"^{name} is of another kind; got .*, expected "):
            everything(**{name: value})


def test_a_value_without_a_repr_is_refused_too():
    class Hostile:
        def __repr__(self) -> str:
            raise RuntimeError

    with pytest.raises(fl.errors.ArgumentError, match="got a Hostile, expected a number"):
        everything(Hostile())


@pytest.mark.parametrize("module", [fl, fl.control])
def test_every_public_function_refuses_other_kinds_by_name(module):
    """The norms, `tune` and `scene_from_urdf` did not: errors of Python's and NumPy's own came through."""
    functions = [one for name in module.__all__ if inspect.isfunction(one := getattr(module, name))]
    taking = [one for one in functions if inspect.signature(one).parameters]
    assert [one.__name__ for one in taking if not hasattr(one, "__wrapped__")] == []


def test_calls_that_do_not_fit_are_python_s_own_matter():
    with pytest.raises(TypeError, match="unexpected keyword"):
        everything(nonsense=1)
    assert everything.__name__ == "everything"


def test_a_message_about_a_kind_is_one_line_with_the_right_article():
    words = r"^s is of another kind; got array\(\[\[1., 0.\], \[0., 1.\]\]\), expected an SX;"
    with pytest.raises(fl.errors.ArgumentError, match=words):
        fl.Manipulator.from_lagrangian(np.eye(2), None, None, None)
