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

KINDS: dict[Any, tuple[list[Any], list[Any]]] = {
    float: (
        [1, 2.5, np.float32(1), np.int64(3), np.array(2.0), np.nan],
        [None, "1", True, np.True_, [1.0], np.ones(1), 1j, b"1"],
    ),
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
    Sequence[tuple[float, float]]: (
        [[(0.1, 0.2)], [[1, 2]], np.ones((2, 2))],
        [[1, 2], [(1, 2, 3)], [("a", "b")], "ab"],
    ),
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


def test_a_value_without_a_repr_is_refused_too():
    class Hostile:
        def __repr__(self) -> str:
            raise RuntimeError

    with pytest.raises(fl.errors.ArgumentError, match="got a Hostile, expected a number"):
        taking(float)(Hostile())


@pytest.mark.parametrize("module", [fl, fl.control])
def test_every_public_function_refuses_other_kinds_by_name(module):
    """The norms, `tune` and `scene_from_urdf` did not: errors of Python's and NumPy's own came through."""
    functions = [one for name in module.__all__ if inspect.isfunction(one := getattr(module, name))]
    taking = [one for one in functions if inspect.signature(one).parameters]
    assert [one.__name__ for one in taking if not hasattr(one, "__wrapped__")] == []


def test_calls_that_do_not_fit_are_python_s_own_matter():
    with pytest.raises(TypeError, match="unexpected keyword"):
        taking(float)(nonsense=1)
    assert taking(float).__name__ == "function"


def test_a_message_about_a_kind_is_one_line_with_the_right_article():
    words = r"^s is of another kind; got array\(\[\[1., 0.\], \[0., 1.\]\]\), expected an SX;"
    with pytest.raises(fl.errors.ArgumentError, match=words):
        fl.Manipulator.from_lagrangian(np.eye(2), None, None, None)
