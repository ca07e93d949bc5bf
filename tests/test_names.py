"""One name for one thing: functions of the numeric wing, submodules beside functions, and the public names."""

import ast
import inspect
import pkgutil
from collections import defaultdict
from importlib import import_module
from pathlib import Path
from types import ModuleType

import flexlin as fl

ROOT = Path(fl.__file__).parent
NUMERIC_WING = sorted([*ROOT.glob("periodic/**/*.py"), *ROOT.glob("kronecker/*.py")])
MODULES = ["flexlin", *(found.name for found in pkgutil.walk_packages(fl.__path__, "flexlin."))]
WHOLE = {"control", "errors", "kronecker", "plots", "screws"}
"""Modules that are public as a whole; other public names in small letters are functions."""


def test_each_function_and_class_of_the_numeric_wing_has_a_name_of_its_own():
    places = defaultdict(list)
    for path in NUMERIC_WING:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("__"):
                places[node.name].append(str(path.relative_to(ROOT)))
    assert len(places) > 100
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_nothing_hides_a_submodule():
    hidden = []
    for name in MODULES:
        package, _, last = name.rpartition(".")
        if package and last != "__main__":
            hidden += [name] if import_module(name) is not getattr(import_module(package), last) else []
    assert hidden == []


def test_public_names_are_functions_classes_and_modules_when_every_module_is_loaded():
    for name in MODULES:
        if not name.endswith("__main__"):
            import_module(name)
    assert set(dir(fl)) == {*fl.__all__, "__version__"}
    kinds = {name: getattr(fl, name) for name in fl.__all__}
    assert {name for name, value in kinds.items() if isinstance(value, ModuleType)} == WHOLE
    for name in kinds.keys() - WHOLE:
        assert (inspect.isclass if name[0].isupper() else inspect.isfunction)(kinds[name]), name
