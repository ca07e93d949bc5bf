"""Every public function with arguments that work, and twenty kinds of nonsense for the place of each."""

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
from flexlin.analyses import Clock, limited
from flexlin.errors import FlexlinError
from flexlin.scene import Accuracy
from tests.public_results import RIGID, arm_results, series_results, stability_results
from tests.torture.trial import Row

Calls = Iterator[partial]
"""Functions with their arguments by name."""
X, U, V = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("v")


@cache
def valid_calls() -> dict[str, tuple[Callable, dict[str, Any]]]:
    """All calls, by the name of the function."""
    parts = (scene_calls, stability_calls, design_calls, export_calls, motion_calls, matrix_calls, screw_calls)
    calls = [call for part in parts for call in part()]
    return {getattr(call.func, "__name__", "polynomial"): (call.func, call.keywords) for call in calls}


def make_plant() -> fl.Linearization:
    """The arm alone."""
    return fl.linearize(arm_results()["arm"], arm_results()["scene"].motion)


def scene_calls() -> Calls:
    """From a scene to its equations, and what is asked of a scene as a whole."""
    scene, arm, lin = (arm_results()[name] for name in ("scene", "arm", "linearization"))
    path, place = "effects.payload.mass", Path(tempfile.mkdtemp())
    links = [{"length": 1.0, "mass_per_length": 1.0}]
    raw = {"schema": 1, "title": "a", "links": links, "motion": scene.motion.model_dump()}
    yield partial(fl.load_scene, source="single-link", overrides={"links.0.modes": 1}, data_folder=place)
    yield partial(fl.parse_scene, raw=raw, source="a", overrides={}, folder=place, data_folder=place)
    yield partial(fl.build_manipulator, scene=scene, parameters=[path])
    yield partial(fl.build_motion, table=scene.motion, joints=1)
    yield partial(fl.linearize, arm=arm, motion=scene.motion, control=scene.control, route="jacobian")
    yield partial(fl.sweep, scene=scene, values={path: [0.1]}, tol=1e-4, grid=False)
    yield partial(fl.sensitivity, scene=scene, paths=[path], tol=1e-4)
    yield partial(fl.audit, scene=fl.load_scene("single-link", RIGID))
    yield partial(fl.simulate, lin=lin, periods=0.05, initial=np.zeros(4), tol=1e-4, points_per_period=16)
    own, rate = ca.SX.sym("own"), ca.SX.sym("rate")
    one = {"s": own, "s_dot": rate}
    yield partial(fl.Manipulator.from_matrices, **one, M=ca.SX(1), C=ca.SX(0), g=own)
    yield partial(fl.Manipulator.from_lagrangian, **one, T=rate**2, V=own**2)


def stability_calls() -> Calls:
    """Periodic systems and their exponents."""
    s, plant, one = stability_results(), make_plant().periodic_system(), np.eye(1)
    A = np.array([[1.0, 2.0], [3.0, 4.0]])
    yield partial(fl.PeriodicSystem, A=A, period=1.0, B=np.eye(2), breaks=[0.5], features=[(0.5, 0.1)])
    yield partial(fl.PeriodicSystem.from_second_order, M=one, D=one, K=one, period=1.0, B=one)
    setting = {"method": "gauss", "order": 8, "segments": 8, "max_segments": 99}
    yield partial(fl.floquet, system=s["system"], tol=1e-6, **setting)
    yield partial(fl.floquet_modes, system=s["system"], result=s["floquet"], tol=1e-6)
    yield partial(fl.forced_response, system=s["system"], f=[0.0, 1.0], tol=1e-6, breaks=[], max_segments=999)
    yield partial(control.sampled_floquet, system=plant, gain=np.ones((1, 4)), sample_time=0.5, delay=0.0, tol=1e-4)


def design_calls() -> Calls:
    """Feedback and estimators, by every kind of design."""
    a, lin = arm_results(), make_plant()
    plant, Q, R = lin.periodic_system(), np.eye(4), np.eye(1)
    problem, N = {"system": plant, "Q": Q, "R": R}, np.zeros((4, 1))
    table = fl.load_scene("single-link", {"links.0.modes": 1}).designs[0]
    yield partial(fl.periodic_lqr, **problem, N=N, tol=1e-5, name="a")
    yield partial(control.averaged_lqr, **problem, N=N, name="a")
    yield partial(control.frozen_lqr, **problem, phases=4)
    yield partial(control.finite_horizon_lqr, **problem, end=Q, tol=1e-4, name="a")
    yield partial(control.design, plant=lin, table=table, tol=1e-4)
    yield partial(control.pd_feedback, system=plant, joints=[0], kp=[1.0], kd=[1.0], name="a")
    yield partial(control.kalman_filter, system=plant, C=np.eye(1, 4), W=Q, V=R, tol=1e-4)
    yield partial(control.output_feedback, made=a["periodic"], estimator=a["estimator"])
    yield partial(control.with_integral_action, system=plant, measured=np.eye(1, 4))


def export_calls() -> Calls:
    """What other programs read."""
    a, plant, folder = arm_results(), make_plant().periodic_system(), Path(tempfile.mkdtemp())
    lin, lqr = a["linearization"], a["periodic"]
    yield partial(control.to_control, system=plant, phase=0.1)
    yield partial(control.periodic_plant, system=plant, name="a")
    yield partial(control.gain_schedule, made=lqr, name="a")
    yield partial(control.save, system=plant, path=folder / "a.npz", designs=(lqr,), phases=4)
    yield partial(control.linearization_source, lin=lin, folder=folder / "c", name="abc")
    yield partial(control.gain_source, made=lqr, period=lin.period, folder=folder / "g", name="abc")
    yield partial(control.estimator_source, estimator=a["estimator"], folder=folder / "e", name="abc")


def motion_calls() -> Calls:
    """Motions beside the rigid one, and what is measured along them."""
    a = arm_results()
    scene, lin = a["scene"], a["linearization"]
    yield partial(control.feedforward, lin=lin, kind="rigid", tol=1e-4)
    yield partial(control.linear_range, lin=lin, share=0.1, modes=1, tol=1e-4)
    yield partial(control.linearize_about, motion=a["elastic motion"], closed=True)
    yield partial(control.periodic_motion, lin=lin, tol=1e-4, linear=False)
    yield partial(control.tip_position, lin=lin)
    yield partial(control.tip_acceleration, lin=lin)
    yield partial(control.joint_angles, lin=lin)
    yield partial(control.bending, scene=scene, lin=lin, link=0, at=0.5)


def matrix_calls() -> Calls:
    """Taylor maps and matrix calculus."""
    matrix, explicit = np.array([[1.0, 2.0], [3.0, 4.0]]), series_results()["taylor"]
    yield partial(fl.taylor, A=ca.sin(X), x=X, x0=[0.1, 0.2], order=2)
    yield partial(fl.implicit_taylor, f=V**2 - U - 1, u=U, v=V, u0=[0.0], v0=[1.0], order=2)
    yield partial(explicit, **{next(iter(inspect.signature(explicit.__call__).parameters)): [0.1, 0.1]})
    yield partial(kronecker.swap, n=2, q=3)
    yield partial(kronecker.kron, A=matrix, B=matrix)
    yield partial(kronecker.kronecker_power, A=matrix, k=2)
    yield partial(kronecker.derivative, A=ca.sin(X), x=X, order=1)
    yield partial(kronecker.product_rule, A=matrix, DA=np.zeros((2, 4)), B=matrix, DB=np.zeros((2, 4)))
    yield partial(kronecker.inverse_rule, A_inverse=matrix, DA=np.zeros((2, 4)))
    yield partial(kronecker.taylor_sum, derivatives=[matrix], delta=np.zeros((2, 1)))


def screw_calls() -> Calls:
    """Screws and chains of them."""
    twist, axis = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), [0, 0, 1]
    yield partial(screws.revolute, axis=axis, point=[0, 0, 0])
    yield partial(screws.prismatic, direction=axis)
    yield partial(screws.helical, axis=axis, point=[0, 0, 0], pitch=0.1)
    yield partial(screws.exponential, t=twist, q=0.1)
    yield partial(screws.hat, t=twist)
    yield partial(screws.ad, t=twist)
    yield partial(screws.Ad, H=np.eye(4))
    yield partial(screws.skew, w=np.ones(3))
    yield partial(screws.OpenChain, screws=[twist], pose=np.eye(4))


LONGEST = 60.0
"""Seconds that a call may take: what is asked for is nonsense."""
NONSENSE = (
    None, True, "motion", "", b"1", -1, 0, 1.5, math.nan, math.inf, 1e300, 10**30, 1j, [], {}, [[1, 2], [3]],
    np.array(["a", "b"]), np.full((2, 2), math.nan), object(), lambda: 1.0, lambda *_: "word", {1, "a"},
)  # fmt: skip


def outcome(function: Callable, arguments: dict[str, Any]) -> str:
    """ "answered", "refused", or what untyped error came through."""
    try:
        with warnings.catch_warnings(), limited("the call", Clock(Accuracy(seconds=LONGEST)).allow("the call")):
            warnings.simplefilter("ignore")
            function(**arguments)
    except FlexlinError:
        return "refused"
    except Exception as fault:
        return f"{type(fault).__name__}: {str(fault)[:100]}"
    return "answered"


def misuse(count: int, number: int, out: Path) -> Row:
    """Each function, each argument: `count` kinds of nonsense, others for each place."""
    row = Row("misuse")
    for at, (name, (function, arguments)) in enumerate(valid_calls().items()):
        if (plain := outcome(function, arguments)) != "answered":
            row.wrong.append(f"{name} does not work as it should: {plain}")
        for place, argument in enumerate(arguments):
            for k in range(count):
                value = NONSENSE[(number + 7 * at + 3 * place + 5 * k) % len(NONSENSE)]
                with chdir(out):  # nonsense may be the name of a file
                    found = outcome(function, {**arguments, argument: value})
                row.runs += 1
                row.answered += found == "answered"
                if found not in ("answered", "refused"):
                    row.blame("uncaught", f"{name}({argument} = {value!r:.40}): {found}")
    return row
