"""The compiled core: its functions are what Python takes them for, and what does not fit is refused before C sees it."""

import importlib
import os
import pkgutil
import re
import subprocess
import sys

import numpy as np
import pytest

import flexlin
from flexlin import _core

NEEDS = "void find_needs(long steps, const Step *code, const int *kinds, int *needs)"


def test_prototypes_are_those_of_the_sources():
    for module in pkgutil.walk_packages(flexlin.__path__, "flexlin."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    texts = [path.read_text(encoding="utf-8") for path in _core.BUILT.parent.rglob("*.c")]
    offered = (one for text in texts for one in re.findall(r"^CALLED ([^{;]*?)\s*\{", text, flags=re.MULTILINE))
    written = {re.sub(r"\s+", " ", one) for one in offered}
    assert len(written) > 3
    assert written - {"int find_level(void)"} == set(_core.DECLARED)


WRONG = [
    (1, np.zeros((2, 4))),  # another type
    (1, np.zeros((4, 2), np.intc).T),  # not in C order
    (1, np.zeros((3, 4), np.intc)),  # another shape
    (1, np.zeros(8, np.intc)),
    (3, np.broadcast_to(np.zeros((), np.intc), 2)),  # not to be written
    (1, None),
]


@pytest.mark.parametrize(("place", "value"), WRONG)
def test_arrays_that_do_not_fit_are_refused(place, value):
    function = _core.Function(NEEDS, lambda steps, *_: ((steps, 4), None, steps), ())
    arguments = [2, np.zeros((2, 4), np.intc), np.ones(1, np.intc), np.zeros(2, np.intc)]
    function(*arguments)
    arguments[place] = value
    with pytest.raises((TypeError, AttributeError)):
        function(*arguments)


def test_an_array_may_be_none_where_that_is_said():
    function, needs = _core.Function(NEEDS, None, ("code", "kinds")), np.full(1, 7, np.intc)
    function(0, None, None, needs)
    assert needs == 7


def test_what_is_no_function_of_the_core_is_not_declared():
    for text in ("void find_needs(steps)", "find_needs(long steps)", "int no_such_function(int n)"):
        with pytest.raises((ValueError, AttributeError)):
            _core.declare(text)


def variants() -> list[str]:
    """The variants that were built and that this processor runs."""
    level = _core.LIBRARY.find_level()
    built = {path.stem for path in _core.BUILT.glob("*.so")}
    return sorted(built & {"baseline", *(name for needs, name in _core.VARIANTS.items() if needs <= level)})


def run_variant(name: str, code: str) -> subprocess.CompletedProcess:
    environment = {**os.environ, "FLEXLIN_CORE": name}
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)


@pytest.mark.slow
def test_each_variant_gives_the_same_answer():
    code = (
        "import flexlin as fl; from flexlin import _core; s = fl.load_scene('single-link')\n"
        "r = fl.floquet(fl.linearize(fl.build_manipulator(s), s.motion, s.control).periodic_system())\n"
        "print(_core.VARIANT, r.verdict, r.error, *sorted(r.exponents.real))"
    )
    found = {}
    for variant in variants():
        name, verdict, *numbers = run_variant(variant, code).stdout.split()
        assert name == variant
        found[variant] = verdict, *map(float, numbers)
    verdict, error, *rates = found["baseline"]
    for other, most, *others in found.values():
        assert other == verdict
        np.testing.assert_allclose(others, rates, rtol=0, atol=error + most)


def test_a_library_that_is_not_there_is_said_plainly():
    said = run_variant("other", "import flexlin._core")
    assert said.returncode == 1
    assert "make core" in said.stderr.splitlines()[-1]


WATCHED = """
import sys
from pathlib import Path

seen = []


def watch(event, arguments):
    if event in ("subprocess.Popen", "os.exec", "os.posix_spawn", "os.system", "ctypes.dlopen"):
        seen.append((event, str(arguments[0])))
    elif event == "open" and isinstance(arguments[1], str) and set(arguments[1]) & set("wax+"):
        seen.append((event, str(arguments[0])))


sys.addaudithook(watch)
import numpy as np

import flexlin as fl

scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
loop = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control).periodic_system()
print(fl.floquet(loop).verdict)
print(fl.floquet(fl.periodic_lqr(loop, np.eye(4), np.eye(1)).closed_loop).verdict)
values = {"effects.payload.mass": np.linspace(0.0, 0.3, 400)}
print(*np.unique(fl.sweep(scene, values, workers=1).verdict))
print(*sorted(set(seen)), sep="\\n")
"""


@pytest.mark.slow
def test_nothing_is_compiled_or_kept_on_a_users_machine(tmp_path):
    """With no program on the path and an empty home: verdicts, a design and a sweep load the library that was built, and no more."""
    environment = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path), "PATH": "", "PYTHONDONTWRITEBYTECODE": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    run = subprocess.run([sys.executable, "-c", WATCHED], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines[:3] == ["stable", "stable", "stable"]
    seen = [line for line in lines[3:] if "None" not in line]
    assert seen
    assert all(line.startswith("('ctypes.dlopen',") and "_core/built/" in line for line in seen), seen
    assert not list(tmp_path.iterdir())
