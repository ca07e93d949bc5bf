"""One call of each public function that works: what nonsense is put into, argument by argument."""

import inspect
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

import flexlin as fl
from flexlin import control, kronecker, screws
from tests.public_results import arm_results, series_results, stability_results

Call = tuple[Callable, dict[str, Any]]


@cache
def valid_calls() -> dict[str, Call]:
    """All calls, by the name of the function."""
    parts = (scene_calls, stability_calls, design_calls, export_calls, motion_calls, matrix_calls, screw_calls)
    return {name: call for part in parts for name, call in part().items()}


def make_plant() -> fl.Linearization:
    """The arm alone."""
    return fl.linearize(arm_results()["arm"], arm_results()["scene"].motion)


def scene_calls() -> dict[str, Call]:
    """From a scene to its equations, and what is asked of a scene as a whole."""
    scene, arm, lin = (arm_results()[name] for name in ("scene", "arm", "linearization"))
    folder = Path(tempfile.mkdtemp())
    raw = {
        "schema": 1,
        "title": "a",
        "links": [{"length": 1.0, "mass_per_length": 1.0}],
        "motion": scene.motion.model_dump(),
    }
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
        "sweep": (
            fl.sweep,
            {
                "scene": scene,
                "values": {"effects.payload.mass": [0.1]},
                "tol": 1e-4,
                "grid": False,
            },
        ),
        "sensitivity": (fl.sensitivity, {"scene": scene, "paths": ["effects.payload.mass"], "tol": 1e-4}),
        "simulate": (
            fl.simulate,
            {"lin": lin, "periods": 0.05, "initial": np.zeros(4), "tol": 1e-4, "points_per_period": 16},
        ),
    }


def stability_calls() -> dict[str, Call]:
    """Periodic systems and their exponents."""
    s, plant = stability_results(), make_plant().periodic_system()
    return {
        "PeriodicSystem": (
            fl.PeriodicSystem,
            {
                "A": np.array([[1.0, 2.0], [3.0, 4.0]]),
                "period": 1.0,
                "B": np.eye(2),
                "breaks": [0.5],
                "features": [(0.5, 0.1)],
            },
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
        "sampled_floquet": (
            control.sampled_floquet,
            {"system": plant, "gain": np.ones((1, 4)), "sample_time": 0.5, "delay": 0.0, "tol": 1e-4},
        ),
    }


def design_calls() -> dict[str, Call]:
    """Feedback and estimators, by every kind of design."""
    a, lin = arm_results(), make_plant()
    plant, Q, R = lin.periodic_system(), np.eye(4), np.eye(1)
    table = fl.load_scene("single-link", {"links.0.modes": 1}).designs[0]
    return {
        "periodic_lqr": (
            fl.periodic_lqr,
            {"system": plant, "Q": Q, "R": R, "N": np.zeros((4, 1)), "tol": 1e-5, "name": "a"},
        ),
        "averaged_lqr": (control.averaged_lqr, {"system": plant, "Q": Q, "R": R, "N": np.zeros((4, 1)), "name": "a"}),
        "frozen_lqr": (control.frozen_lqr, {"system": plant, "Q": Q, "R": R, "phases": 4}),
        "finite_horizon_lqr": (
            control.finite_horizon_lqr,
            {"system": plant, "Q": Q, "R": R, "end": Q, "tol": 1e-4, "name": "a"},
        ),
        "design": (control.design, {"plant": lin, "table": table, "tol": 1e-4}),
        "pd_feedback": (control.pd_feedback, {"system": plant, "joints": [0], "kp": [1.0], "kd": [1.0], "name": "a"}),
        "kalman_filter": (control.kalman_filter, {"system": plant, "C": np.eye(1, 4), "W": Q, "V": R, "tol": 1e-4}),
        "output_feedback": (control.output_feedback, {"made": a["periodic"], "estimator": a["estimator"]}),
        "with_integral_action": (control.with_integral_action, {"system": plant, "measured": np.eye(1, 4)}),
    }


def export_calls() -> dict[str, Call]:
    """What other programs read."""
    a, plant, folder = arm_results(), make_plant().periodic_system(), Path(tempfile.mkdtemp())
    lin, lqr = a["linearization"], a["periodic"]
    return {
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
    }


def motion_calls() -> dict[str, Call]:
    """Motions beside the rigid one, and what is measured along them."""
    a = arm_results()
    scene, lin = a["scene"], a["linearization"]
    return {
        "feedforward": (control.feedforward, {"lin": lin, "kind": "rigid", "tol": 1e-4}),
        "linear_range": (control.linear_range, {"lin": lin, "share": 0.1, "modes": 1, "tol": 1e-4}),
        "linearize_about": (control.linearize_about, {"motion": a["elastic motion"], "closed": True}),
        "periodic_motion": (control.periodic_motion, {"lin": lin, "tol": 1e-4, "linear": False}),
        "tip_position": (control.tip_position, {"lin": lin}),
        "tip_acceleration": (control.tip_acceleration, {"lin": lin}),
        "joint_angles": (control.joint_angles, {"lin": lin}),
        "bending": (control.bending, {"scene": scene, "lin": lin, "link": 0, "at": 0.5}),
    }


def matrix_calls() -> dict[str, Call]:
    """Taylor maps and matrix calculus."""
    x, u, v = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("v")
    matrix, explicit = np.array([[1.0, 2.0], [3.0, 4.0]]), series_results()["taylor"]
    return {
        "taylor": (fl.taylor, {"A": ca.sin(x), "x": x, "x0": [0.1, 0.2], "order": 2}),
        "implicit_taylor": (
            fl.implicit_taylor,
            {"f": v**2 - u - 1, "u": u, "v": v, "u0": [0.0], "v0": [1.0], "order": 2},
        ),
        "polynomial": (explicit, {next(iter(inspect.signature(explicit.__call__).parameters)): [0.1, 0.1]}),
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
    }


def screw_calls() -> dict[str, Call]:
    """Screws and chains of them."""
    twist = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    return {
        "revolute": (screws.revolute, {"axis": [0, 0, 1], "point": [0, 0, 0]}),
        "prismatic": (screws.prismatic, {"direction": [0, 0, 1]}),
        "helical": (screws.helical, {"axis": [0, 0, 1], "point": [0, 0, 0], "pitch": 0.1}),
        "exponential": (screws.exponential, {"t": twist, "q": 0.1}),
        "hat": (screws.hat, {"t": twist}),
        "ad": (screws.ad, {"t": twist}),
        "Ad": (screws.Ad, {"H": np.eye(4)}),
        "skew": (screws.skew, {"w": np.ones(3)}),
        "OpenChain": (screws.OpenChain, {"screws": [twist], "pose": np.eye(4)}),
    }
