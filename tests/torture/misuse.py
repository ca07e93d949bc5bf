"""Every public function with valid arguments, and twenty kinds of nonsense for the place of each."""

import inspect
import math
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir
from functools import cache, partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

import flexlin as fl
from flexlin import control, kronecker, screws
from flexlin.answers.budget import Budget
from flexlin.answers.limits import limited
from flexlin.errors import FlexlinError
from flexlin.scene.accuracy import Accuracy
from tests.public_results import arm_results, series_results, stability_results
from tests.torture.rows import Row

LONGEST = 60.0
"""Seconds that a call may take: what is asked for is nonsense."""
NONSENSE: dict[str, Any] = {
    "None": None,
    "True": True,
    "a text": "motion",
    "no text": "",
    "bytes": b"1",
    "-1": -1,
    "0": 0,
    "1.5": 1.5,
    "nan": math.nan,
    "inf": math.inf,
    "1e300": 1e300,
    "10**30": 10**30,
    "1j": 1j,
    "[]": [],
    "{}": {},
    "a ragged list": [[1, 2], [3]],
    "words": np.array(["a", "b"]),
    "an array of nan": np.full((2, 2), math.nan),
    "an object": object(),
    "a function of nothing": lambda: 1.0,
    "a function of words": lambda *_: "word",
    "a set": {1, "a"},
}
Call = tuple[Callable, dict[str, Any]]


@cache
def valid_calls() -> dict[str, Call]:
    """One call of each public function that works, by name."""
    a, s, t = arm_results(), stability_results(), series_results()
    scene, arm, lin, lqr = a["scene"], a["arm"], a["linearization"], a["periodic"]
    plant, Q, R = fl.linearize(arm, scene.motion).periodic_system(), np.eye(4), np.eye(1)
    x, u, v = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("v")
    folder = Path(tempfile.mkdtemp())
    raw = {
        "schema": 1,
        "title": "a",
        "links": [{"length": 1.0, "mass_per_length": 1.0}],
        "motion": scene.motion.model_dump(),
    }
    matrix, twist = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    table = fl.load_scene("single-link", {"links.0.modes": 1}).designs[0]
    return {
        "load_scene": (
            fl.load_scene,
            {"source": "single-link", "overrides": {"links.0.modes": 1}, "data_folder": folder},
        ),
        "parse_scene": (
            fl.parse_scene,
            {"raw": raw, "source": "a", "overrides": {}, "folder": folder, "data_folder": folder},
        ),
        "build_manipulator": (fl.build_manipulator, {"scene": scene, "parameters": ["effects.payload.mass"]}),
        "build_motion": (fl.build_motion, {"table": scene.motion, "joints": 1}),
        "linearize": (
            fl.linearize,
            {"arm": arm, "motion": scene.motion, "control": scene.control, "route": "jacobian"},
        ),
        "PeriodicSystem": (
            fl.PeriodicSystem,
            {"A": matrix, "period": 1.0, "B": np.eye(2), "breaks": [0.5], "features": [(0.5, 0.1)]},
        ),
        "from_second_order": (
            fl.PeriodicSystem.from_second_order,
            {"M": np.eye(1), "D": np.eye(1), "K": np.eye(1), "period": 1.0, "B": np.eye(1)},
        ),
        "floquet": (
            fl.floquet,
            {"system": s["system"], "tol": 1e-6, "method": "gauss", "order": 8, "segments": 8, "max_segments": 99},
        ),
        "floquet_modes": (fl.floquet_modes, {"system": s["system"], "result": s["floquet"], "tol": 1e-6}),
        "forced_response": (
            fl.forced_response,
            {"system": s["system"], "f": [0.0, 1.0], "tol": 1e-6, "breaks": [], "max_segments": 999},
        ),
        "periodic_lqr": (
            fl.periodic_lqr,
            {"system": plant, "Q": Q, "R": R, "N": np.zeros((4, 1)), "tol": 1e-5, "name": "a"},
        ),
        "simulate": (
            fl.simulate,
            {"lin": lin, "periods": 0.05, "initial": np.zeros(4), "tol": 1e-4, "points_per_period": 16},
        ),
        "sweep": (
            fl.sweep,
            {
                "scene": scene,
                "values": {"effects.payload.mass": [0.1]},
                "tol": 1e-4,
                "grid": False,
                "chunk_bytes": 2**20,
            },
        ),
        "sensitivity": (fl.sensitivity, {"scene": scene, "paths": ["effects.payload.mass"], "tol": 1e-4}),
        "taylor": (fl.taylor, {"A": ca.sin(x), "x": x, "x0": [0.1, 0.2], "order": 2}),
        "implicit_taylor": (
            fl.implicit_taylor,
            {"f": v**2 - u - 1, "u": u, "v": v, "u0": [0.0], "v0": [1.0], "order": 2},
        ),
        "averaged_lqr": (control.averaged_lqr, {"system": plant, "Q": Q, "R": R, "N": np.zeros((4, 1)), "name": "a"}),
        "frozen_lqr": (control.frozen_lqr, {"system": plant, "Q": Q, "R": R, "phases": 4}),
        "finite_horizon_lqr": (
            control.finite_horizon_lqr,
            {"system": plant, "Q": Q, "R": R, "end": Q, "tol": 1e-4, "name": "a"},
        ),
        "design": (control.design, {"plant": fl.linearize(arm, scene.motion), "table": table, "tol": 1e-4}),
        "pd_feedback": (control.pd_feedback, {"system": plant, "joints": [0], "kp": [1.0], "kd": [1.0], "name": "a"}),
        "kalman_filter": (control.kalman_filter, {"system": plant, "C": np.eye(1, 4), "W": Q, "V": R, "tol": 1e-4}),
        "output_feedback": (control.output_feedback, {"made": lqr, "estimator": a["estimator"]}),
        "with_integral_action": (control.with_integral_action, {"system": plant, "measured": np.eye(1, 4)}),
        "to_control": (control.to_control, {"system": plant, "phase": 0.1}),
        "periodic_plant": (control.periodic_plant, {"system": plant, "name": "a"}),
        "gain_schedule": (control.gain_schedule, {"made": lqr, "name": "a"}),
        "save": (control.save, {"system": plant, "path": folder / "a.npz", "designs": (lqr,), "phases": 4}),
        "linearization_source": (control.linearization_source, {"lin": lin, "folder": folder / "c", "name": "abc"}),
        "gain_source": (
            control.gain_source,
            {"made": lqr, "period": lin.period, "folder": folder / "g", "name": "abc", "samples": 16},
        ),
        "estimator_source": (
            control.estimator_source,
            {"estimator": a["estimator"], "folder": folder / "e", "name": "abc", "samples": 16},
        ),
        "feedforward": (control.feedforward, {"lin": lin, "kind": "rigid", "tol": 1e-4}),
        "linear_range": (control.linear_range, {"lin": lin, "share": 0.1, "modes": 1, "tol": 1e-4}),
        "linearize_about": (control.linearize_about, {"motion": a["elastic motion"], "closed": True}),
        "periodic_motion": (control.periodic_motion, {"lin": lin, "tol": 1e-4, "linear": False}),
        "tip_position": (control.tip_position, {"lin": lin}),
        "tip_acceleration": (control.tip_acceleration, {"lin": lin}),
        "joint_angles": (control.joint_angles, {"lin": lin}),
        "bending": (control.bending, {"scene": scene, "lin": lin, "link": 0, "at": 0.5}),
        "sampled_floquet": (
            control.sampled_floquet,
            {"system": plant, "gain": np.ones((1, 4)), "sample_time": 0.5, "delay": 0.0, "tol": 1e-4},
        ),
        "swap": (kronecker.swap, {"n": 2, "q": 3}),
        "kron": (kronecker.kron, {"A": matrix, "B": matrix}),
        "kronecker_power": (kronecker.kronecker_power, {"A": matrix, "k": 2}),
        "derivative": (kronecker.derivative, {"A": ca.sin(x), "x": x, "order": 1}),
        "product_rule": (
            kronecker.product_rule,
            {"A": matrix, "DA": np.zeros((2, 4)), "B": matrix, "DB": np.zeros((2, 4))},
        ),
        "inverse_rule": (kronecker.inverse_rule, {"A_inverse": matrix, "DA": np.zeros((2, 4))}),
        "taylor_sum": (kronecker.taylor_sum, {"derivatives": [matrix], "delta": np.zeros((2, 1))}),
        "revolute": (screws.revolute, {"axis": [0, 0, 1], "point": [0, 0, 0]}),
        "prismatic": (screws.prismatic, {"direction": [0, 0, 1]}),
        "helical": (screws.helical, {"axis": [0, 0, 1], "point": [0, 0, 0], "pitch": 0.1}),
        "exponential": (screws.exponential, {"t": twist, "q": 0.1}),
        "hat": (screws.hat, {"t": twist}),
        "ad": (screws.ad, {"t": twist}),
        "Ad": (screws.Ad, {"H": np.eye(4)}),
        "skew": (screws.skew, {"w": np.ones(3)}),
        "OpenChain": (screws.OpenChain, {"screws": [twist], "pose": np.eye(4)}),
        "polynomial": (t["taylor"], {next(iter(inspect.signature(t["taylor"].__call__).parameters)): [0.1, 0.1]}),
    }


def misuses(name: str, kinds: Callable[[int], list[str]]) -> Iterator[tuple[str, str, str]]:
    """Put nonsense of some kinds in the place of each argument: gives argument, kind, and what came out."""
    function, arguments = valid_calls()[name]
    for number, place in enumerate(arguments):
        for kind in kinds(number):
            yield place, kind, outcome(function, {**arguments, place: NONSENSE[kind]})


def outcome(function: Callable, arguments: dict[str, Any]) -> str:
    """ "answered", "refused", or what untyped error came through."""
    try:
        with warnings.catch_warnings(), limited("the call", Budget().allow("the call", Accuracy(seconds=LONGEST))):
            warnings.simplefilter("ignore")
            function(**arguments)
    except FlexlinError:
        return "refused"
    except Exception as fault:
        return f"{type(fault).__name__}: {str(fault)[:100]}"
    return "answered"


def misuse(count: int, number: int, out: Path) -> Row:
    """Each function, each argument: `count` kinds of nonsense, another choice for each."""
    row, kinds = Row("misuse"), list(NONSENSE)
    for place, name in enumerate(valid_calls()):
        function, arguments = valid_calls()[name]
        if (plain := outcome(function, arguments)) != "answered":
            row.wrong.append(f"{name} does not work as it should: {plain}")
        chosen = partial(choose, kinds, count, number + 7 * place)
        with chdir(out):  # nonsense may be the name of a file
            tried = list(misuses(name, chosen))
        for argument, kind, found in tried:
            row.runs += 1
            row.answered += found == "answered"
            if found not in ("answered", "refused"):
                row.uncaught += 1
                row.wrong.append(f"{name}({argument} = {kind}): {found}")
    return row


def choose(kinds: list[str], count: int, start: int, place: int) -> list[str]:
    """Some of the kinds, others for each place."""
    return [kinds[(start + 3 * place + 5 * k) % len(kinds)] for k in range(min(count, len(kinds)))]
