"""Public docstrings: in numpydoc form, with the parameters of the signature, and with examples that run."""

import dataclasses
import doctest
import inspect
import pkgutil
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from numpydoc.docscrape import NumpyDocString, get_doc_object
from numpydoc.validate import validate

import flexlin as fl
from flexlin.scene import effects, library

MODULES = [f"flexlin.{name}" for name in ("mechanics", "scene", "motion", "series", "simulation")]
MODULES += [f"flexlin.analyses.{name}" for name in ("audit", "accuracy")]
NOT_LISTED = [
    *(f"riccati.riccati.{name}" for name in ("periodic_riccati", "finite_horizon_riccati", "periodic_lyapunov")),
    *("riccati.linear_quadratic.RiccatiSolution", "response.forced.ForcedResponse"),
]
"""Public by their docstrings, in modules that list no public names."""
FORM = {"GL06", "GL07", "GL08", "SS01", "SS06", "RT01", "RT03", "YD01"}
"""numpydoc's numbers of mistakes: sections unknown or in another order, summaries, what is returned or yielded and not described."""
PARAMETERS = {"PR01", "PR02", "PR03", "PR04", "PR07"}
"""Parameters that are not described, not there, in another order, without type or description."""
BRANCHES = {"InputError", "OutputError", "NumericalError", "IllPosedSegment"}
"""Errors that only name a branch, or a case that no short example provokes."""


def public_names() -> dict[str, Any]:
    """Every public function and class by a dotted name, each once."""
    found: dict[int, tuple[str, Any]] = {}

    def add(name: str, value: Any) -> None:
        if isinstance(value, ModuleType):
            for inner in value.__all__:
                add(f"{value.__name__}.{inner}", getattr(value, inner))
        elif callable(value):
            found.setdefault(id(value), (name, value))

    for name in fl.__all__:
        add(f"flexlin.{name}", getattr(fl, name))
    for name in MODULES:
        add(name, import_module(name))
    for name in NOT_LISTED:
        module, _, last = f"flexlin.periodic.{name}".rpartition(".")
        add(f"{module}.{last}", getattr(import_module(module), last))
    return dict(found.values())


def public_methods(name: str, kind: type) -> Iterator[tuple[str, Any]]:
    """The public methods that flexlin itself wrote, with those of its base classes."""
    for base in kind.__mro__:
        for key, value in vars(base).items():
            function = getattr(value, "__func__", value)
            if inspect.isfunction(function) and not key.startswith("_") and base.__module__.startswith("flexlin"):
                yield f"{name}.{key}", function


NAMES = public_names()
METHODS = {key: f for name, kind in NAMES.items() if inspect.isclass(kind) for key, f in public_methods(name, kind)}
METHODS = {key: f for key, f in METHODS.items() if f.__qualname__.split(".")[0] not in ("Table", "EffectTable")}


def mistakes(value: Any, wanted: set[str]) -> dict[str, str]:
    """What numpydoc's own check finds, among what is wanted."""
    return {code: message for code, message in validate(get_doc_object(value))["errors"] if code in wanted}


def test_the_walk_reaches_what_is_public():
    assert len(METHODS) > 50
    assert {"flexlin.linearize", "flexlin.control.Design", "flexlin.mechanics.register_effect"} <= set(NAMES)
    assert {"flexlin.Manipulator.from_matrices", "flexlin.Linearization.M"} <= set(METHODS)


def test_functions_and_classes_and_methods():
    found = {name: mistakes(method, FORM | PARAMETERS) for name, method in METHODS.items()}
    for name, value in NAMES.items():
        found[name] = mistakes(value, FORM | (PARAMETERS if constructed(value) else set()))
    assert {name: wrong for name, wrong in found.items() if wrong} == {}


def constructed(value: Any) -> bool:
    """Whether users call it with arguments that it checks or explains: a function, or a class that is no result and no subclass."""
    doc = NumpyDocString(inspect.getdoc(value) or "")
    result = dataclasses.is_dataclass(value) and doc["Attributes"] and not doc["Parameters"]
    return not inspect.isclass(value) or ("__init__" in vars(value) and not result)


@pytest.mark.parametrize("name", [name for name, value in NAMES.items() if dataclasses.is_dataclass(value)])
def test_every_field_is_described(name):
    doc = NumpyDocString(inspect.getdoc(NAMES[name]) or "")
    entries = doc["Parameters"] + doc["Attributes"]
    described = [part.strip() for entry in entries for part in entry.name.split(",")]
    bases = [base for base in NAMES[name].__mro__[1:] if dataclasses.is_dataclass(base)]
    inherited = {field.name for base in bases for field in dataclasses.fields(base)}
    fields = {field.name for field in dataclasses.fields(NAMES[name]) if field.repr}
    arguments = set(inspect.signature(NAMES[name]).parameters)
    assert fields - inherited <= set(described) <= fields | inherited | arguments
    assert all(entry.desc for entry in entries)


TREE = ["flexlin", *(found.name for found in pkgutil.walk_packages(fl.__path__, "flexlin."))]


def has_examples(name: str) -> bool:
    """Whether a module shows any."""
    found = find_spec(name)
    return found is not None and ">>> " in Path(found.origin).read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in TREE if has_examples(name)])
def test_examples_run(name, monkeypatch):
    monkeypatch.setattr(effects, "_REGISTRY", effects.known_effects())
    monkeypatch.setattr(library, "_REGISTRY", dict(library._REGISTRY))
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    for test in doctest.DocTestFinder(exclude_empty=True).find(import_module(name), extraglobs={}):
        test.globs.clear()  # an example imports what it uses
        test.globs["__name__"] = "__main__"
        messages: list[str] = []
        assert runner.run(test, out=messages.append).failed == 0, "".join(messages)


def test_public_names_have_examples_among_those_that_run():
    finder = doctest.DocTestFinder(recurse=False)
    silent = [value.__name__ for name, value in NAMES.items() if not finder.find(value, name)[0].examples]
    assert {*silent} <= BRANCHES
