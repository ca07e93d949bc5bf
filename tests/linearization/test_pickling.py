"""Pickling: what comes back, in this process and in a fresh one, gives the same numbers to the last bit."""

import dataclasses
import importlib
import inspect
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin import series, simulation
from flexlin.errors import FlexlinError
from tests import public_results as made_of
from tests.closed_arm import both, closed

pytestmark = pytest.mark.xdist_group("public results")

T = np.array([0.0, 0.13, 0.57, 1.21])

FRESH = """
import pickle, sys
import numpy as np
objects, t = pickle.load(open(sys.argv[1], "rb"))
sys.path.insert(0, sys.argv[3])
from tests.linearization.test_pickling import numbers
pickle.dump({name: numbers(value, t) for name, value in objects.items()}, open(sys.argv[2], "wb"))
"""


ANSWERS = {
    "Linearization": lambda v, t: [
        *vars(v.sample(t)).values(),
        *numbers(v.law, t),
        v.law.torque(t, np.ones((len(t), 2 * v.n))),
    ],
    "Deviation": lambda v, t: [*v.positions(t, np.ones((len(t), v.n)))],
    "Law": lambda v, t: [v.forward(t), v.gain(t), v.reference(t)],
    "PeriodicSystem": lambda v, t: [v.A(t), *([] if v.B is None else [v.B(t)]), np.array(v.breaks)],
    "Design": lambda v, t: [v.K(t), v.closed_loop.A(t), *([] if v.solution is None else [v.X(t)])],
    "Sensors": lambda v, t: [v.C(t), v.V, v.W(t)],
    "Estimator": lambda v, t: [v.P(t), v.L(t), v.closed_loop.A(t)],
    "PeriodicMotion": lambda v, t: [v.state(t), v.torque(t), np.array([v.error])],
    "Feedforward": lambda v, t: [v.torque(t), v.reference(t), np.array([v.tip_error])],
    "TaylorMap": lambda v, t: [v(np.outer(t, np.ones(len(v.x0))))],
    "Polynomial": lambda v, t: [v(np.outer(t, np.ones(v.indices.n)))],
    "RiccatiSolution": lambda v, t: [v.X(t), v.K(t), np.array([v.error, v.gain_error])],
    "OpenChain": lambda v, t: [v.pose(np.full(v.n, 0.3))],
    "Radius": lambda v, t: [np.array([float(v), v.location, v.estimate]), v.v],
    "Dataset": lambda v, t: [np.asarray(v[name]) for name in sorted(v.variables)],
}


def numbers(value, t):
    """Everything that an object answers, as arrays."""
    kind = type(value).__name__
    if kind in ANSWERS:
        return ANSWERS[kind](value, t)
    if kind in ("Manipulator", "FlexibleManipulator"):
        x, p = np.linspace(0.1, 0.4, value.n), np.asarray(value.parameters.values)
        out = []
        for function in value.functions.values():
            inputs = [p if name == "p" else x[: function.numel_in(name)] for name in function.name_in()]
            out.append(function(*inputs).full())
        return out
    if kind == "ParametricLoop":
        point = 1.1 * value.nominal
        return [*value.sample(t[:2] / 9, point[None]), value.periods(point[None]), value.at(point).M(t)]
    if kind == "ImplicitMap":
        at = 0.01 * t[:, None]
        return [value(at), value.refined(at), value.error(at), value.jacobian(2), np.array([value.radius([1.0])])]
    return [value(t)] if kind == "ForcedResponse" or callable(value) else leaves(value)


def leaves(value):
    """All numbers and texts inside an object, a tuple or a table, in order."""
    if isinstance(value, np.ndarray | float | int | complex | str | None):
        return [np.asarray(value if value is not None else "none")]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, tuple | list) else None
    if parts is None:
        parts = [value.name_in()] if type(value).__name__ == "Function" else getattr(value, "__dict__", {}).values()
    return [leaf for part in parts for leaf in leaves(part)]


def assert_same(expected, found, name=""):
    """The same arrays to the last bit."""
    for a, b in zip(expected, found, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


def check(objects, folder):
    """Round trips here and in a fresh interpreter."""
    source, target = folder / "objects.pickle", folder / "numbers.pickle"
    source.write_bytes(pickle.dumps((objects, T)))
    found = [{name: numbers(value, T) for name, value in pickle.loads(source.read_bytes())[0].items()}]
    subprocess.run([sys.executable, "-c", FRESH, source, target, Path(__file__).parents[2]], check=True)
    found.append(pickle.loads(target.read_bytes()))
    for name, value in objects.items():
        for got in found:
            assert_same(numbers(value, T), got[name], name)


SCENES = ["single-link", "de-luca-siciliano-1991", "flexible-joint-link", "pick-and-place", "khang-2019", "five-bar"]


@pytest.mark.slow
def test_linear_equations_of_every_make(tmp_path):
    """Of links in chains and loops, joints that give, a model by hand, a motion from a table; open and closed."""
    t, file = np.linspace(0.0, 2.0, 41), tmp_path / "sine.csv"
    np.savetxt(file, np.column_stack([t, 0.5 * np.sin(np.pi * t)]), delimiter=",", header="t,q1", comments="")
    table = closed("single-link", {"motion": {"kind": "table", "file": str(file)}}, tmp_path)
    objects = {}
    for name, lin in {"table": table, **{name: closed(name) for name in SCENES}}.items():
        plant = fl.linearize(lin.arm, lin.motion)
        parts = {"": lin, "arm": lin.arm, "deviation": lin.about, "law": lin.law}
        parts |= {"plant": plant, "system": lin.periodic_system(), "horizon": fl.control.horizon_system(plant)}
        objects |= {f"{name} {part}": value for part, value in parts.items()}
    check(objects, tmp_path)


def test_an_arm_that_came_back_is_linearized_as_before():
    scene, _, lin = both("de-luca-siciliano-1991", {})
    scene, arm = pickle.loads(pickle.dumps((scene, lin.arm)))
    assert_same(numbers(lin, T), numbers(fl.linearize(arm, scene.motion, scene.control), T))


@pytest.mark.slow
def test_every_public_result(tmp_path):
    objects = made_of.public_results()
    assert all(numbers(value, T) for value in objects.values())
    check(objects, tmp_path)


@pytest.mark.slow
def test_every_result_class_is_tried():
    """The classes whose instances public functions hand back, by their annotations."""
    tried = {kind.__name__ for value in made_of.public_results().values() for kind in type(value).__mro__}
    for module in (fl, fl.control, fl.kronecker, series, simulation):
        for name, value in ((name, getattr(module, name)) for name in module.__all__):
            if inspect.isfunction(value):
                words = set(re.findall(r"[A-Z]\w+", str(inspect.signature(value).return_annotation).split(".")[-1]))
                words -= {"Kind"}  # the mark of an array, no result
                home = inspect.getmodule(value)
                assert {word for word in words if dataclasses.is_dataclass(getattr(home, word, None))} <= tried, name


@pytest.mark.parametrize("by_dask", [False, True])
def test_errors_come_back_whole(by_dask):
    """Dask's workers register a way of their own for exceptions, which does without a class's constructor."""
    if by_dask:
        importlib.import_module("distributed")
    kinds = {kind for kind in vars(fl.errors).values() if inspect.isclass(kind) and issubclass(kind, FlexlinError)}
    kinds = {kind for kind in kinds if kind.__init__ is FlexlinError.__init__}
    assert len(kinds) > 15
    scene = fl.errors.SceneError("scene.toml", [fl.errors.Problem("links.0.length", "-1", "a positive number")])
    for error in (scene, *(kind("a", got=1, expected="b", todo="c") for kind in kinds)):
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
