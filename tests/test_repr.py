"""The repr of every public result: a few lines that say what it is, whatever its size."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from flexlin.summary import represent
from tests.public_results import public_results

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
