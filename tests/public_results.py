"""One of each public result, of small scenes: what the tests of pickling and of `repr` go through."""

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

import flexlin as fl
from flexlin import control, periodic_lyapunov
from flexlin.linearization import parametric_loop
from flexlin.periodic import find_resonances, finite_horizon_riccati, periodic_riccati
from flexlin.scene import EstimatorTable
from flexlin.series import solve_implicit
from flexlin.simulation import region_of_attraction
from tests.closed_arm import both

SMALL, RIGID = ({"links.0.modes": modes, "designs": []} for modes in (1, 0))


class Made(dict[str, Any]):
    """Results by name, each made by its function when it is first asked for."""

    def __init__(self, ways: dict[str, Callable[[], Any]]) -> None:
        super().__init__({name: cache(way) for name, way in ways.items()})

    def __getitem__(self, name: str) -> Any:
        return super().__getitem__(name)()


def swinging(t: np.ndarray) -> np.ndarray:
    """The stiffness of Mathieu's equation."""
    return (1.0 + 0.5 * np.cos(2 * t))[:, None, None]


def oscillator(d: float, k: float = 1.0) -> fl.PeriodicSystem:
    """y'' + d y' + k y = 0."""
    return fl.PeriodicSystem([[0.0, 1.0], [-k, -d]], 1.0)


@cache
def series_results() -> dict[str, Any]:
    """Taylor maps of an explicit function and of the four-bar-like closure v^2 + u v = 1 + u."""
    x, u, v = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("v")
    closure = v**2 + ca.sin(u) * v - 1 - u
    implicit = fl.implicit_taylor(closure, u, v, [0.2], solve_implicit(closure, u, v, [0.2], [1.0]), 5)
    explicit = fl.taylor(ca.vertcat(ca.sin(x[0] * x[1]), ca.exp(x[0])), x, [0.3, 0.7], 4)
    return {
        "taylor": explicit,
        "implicit": implicit,
        "radius": implicit.radius([1.0]),
        "polynomial": explicit.polynomial,
        "chain of screws": fl.screws.OpenChain([fl.screws.revolute([0, 0, 1], [0.1, 0.2, 0.3])]),
        "swap": fl.kronecker.linearized_product(np.eye(2), np.ones((2, 1)), np.zeros((2, 4)), np.ones((2, 2))),
    }


@cache
def stability_results() -> Made:
    """Answers about Mathieu's equation inside its first tongue, about weights, and about forces."""
    system = fl.PeriodicSystem.from_second_order(np.eye(1), 0.1 * np.eye(1), swinging, np.pi, B=np.eye(1))
    damped = fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]])
    made = Made(
        {
            "system": lambda: system,
            "floquet": lambda: fl.floquet(system, tol=1e-7),
            "modes": lambda: fl.floquet_modes(system, made["floquet"]),
            "resonance": lambda: find_resonances(system, made["modes"])[0],
            "riccati": lambda: periodic_riccati(system, np.eye(2), np.eye(1), tol=1e-7),
            "lyapunov": lambda: periodic_lyapunov(system.feedback(made["riccati"].K), np.eye(2), tol=1e-6),
            "horizon": lambda: finite_horizon_riccati(system, np.eye(2), np.eye(1), np.eye(2), tol=1e-7),
            "forced": lambda: fl.forced_response(system, [0.0, 1.0], tol=1e-7),
            "h2": lambda: fl.h2_norm(system.feedback(made["riccati"].K), np.eye(2)),
            "tuning": lambda: fl.tune(lambda gain: oscillator(gain), {"gain": 0.3}, starts=1, steps=1),
            "critical": lambda: fl.critical_values(oscillator, "d", (-0.1, 0.2), samples=9)[0],
            "boundary": lambda: fl.stability_boundary(oscillator, {"d": (-0.1, 0.2), "k": (1.0, 2.0)})[0],
            "nearest": lambda: fl.nearest_instability(oscillator, {"d": (0.1, 0.3)}, own=[0.2]),
            "margins": lambda: fl.margins(fl.PeriodicSystem([[0.0]], 1.0, B=[[1.0]]), [[2.0]]),
            "hinf": lambda: fl.hinf_norm(damped, [[1.0]]),
            "zeros": lambda: fl.invariant_zeros(system, [[1.0, 1.0]], tol=1e-7),
            "output design": lambda: fl.output_lqr(damped, [[1.0]], [[1.0]], [[1.0]]),
            "sampled estimator": lambda: fl.sampled_estimator(damped, [[1.0]], [[1.0]], [[1.0]], 0.5),
            "sampled design": lambda: fl.sampled_lqr(damped, [[1.0]], [[1.0]], 0.5),
            "transient": lambda: fl.respond(damped, [0.0, 1.0], u=[4.0]),
            "frequency response": lambda: fl.frequency_response(damped, [[1.0]], [1.0]),
        }
    )
    return made


@cache
def logged_results() -> dict[str, Any]:
    """What a log of an arm at rest says of it."""
    rigid = fl.load_scene("single-link", RIGID | {"effects.gravity": "off"})
    t = np.arange(300) * 0.01
    log = fl.Log(t, inputs={"q1": 0 * t}, outputs={"q1": 0 * t})
    found = fl.identify(rigid, log, ["effects.payload.mass"], starts=1)
    chosen = fl.select_effects(rigid, log, ["effects.payload.mass"], ["viscous_friction"], window=0.5)
    return {"log": log, "prediction": fl.predict(rigid, log), "identification": found, "effects of a log": chosen}


@cache
def arm_results() -> Made:
    """What is made of one scene, from its arm to the region of attraction."""
    scene, plant, lin = both("single-link", SMALL)
    arm = lin.arm
    system = plant.periodic_system()
    weights = np.diag([1.0, 1.0, 0.01, 0.01]), 100 * np.eye(1)
    T, angles = np.linspace(0.0, lin.period, 8, endpoint=False), control.joint_angles(plant)
    table = EstimatorTable(encoders=1e-4, tip=1e-3, torque=0.01)
    made = Made(
        {
            "scene": lambda: scene,
            "arm": lambda: arm,
            "motion": lambda: fl.build_motion(scene.motion, arm.joints),
            "linearization": lambda: lin,
            "coefficients": lambda: lin.sample(np.array([0.1, 0.2])),
            "deviation": lambda: lin.about,
            "law": lambda: lin.law,
            "parametric": lambda: parametric_loop(scene, ["effects.payload.mass"]),
            "periodic": lambda: control.periodic_lqr(system, *weights, tol=1e-7),
            "frozen": lambda: control.frozen_lqr(system, *weights, phases=4),
            "averaged": lambda: control.averaged_lqr(system, *weights),
            "finite horizon": lambda: control.finite_horizon_lqr(system, *weights, tol=1e-6),
            "pd": lambda: control.pd_feedback(system, [0], [10.0], [1.0]),
            "estimator": lambda: control.kalman_filter(system, angles, 0.1 * np.eye(4), 1e-4 * np.eye(1), tol=1e-6),
            "drive load": lambda: control.drive_load(lin, T, np.zeros((len(T), 4)), lin.law),
            "sensors": lambda: control.scene_sensors(scene, plant, table),
            "loop": lambda: control.output_feedback(made["periodic"], made["estimator"]),
            "integral": lambda: control.with_integral_action(system, np.eye(1, 4)),
            "elastic motion": lambda: control.periodic_motion(lin),
            "about it": lambda: control.linearize_about(made["elastic motion"]),
            "feedforward": lambda: control.feedforward(lin, "tip-exact"),
            "its law": lambda: control.feedforward(lin, "joint-exact").law,
            "response": lambda: fl.forced_response(lin.periodic_system(), lin.forcing, tol=1e-7),
            "camera": lambda: control.tip_position(lin),
            "accelerometer": lambda: control.tip_acceleration(lin)[0],
            "range": lambda: control.linear_range(lin),
            "simulation": lambda: fl.simulate(lin, 0.1),
            "attraction": lambda: region_of_attraction(lin, modes=1, periods=1.0, halvings=1, tol=1e-4),
        }
    )
    return made


@cache
def answer_results() -> dict[str, Any]:
    """Sweep, sensitivities, audit and cost of one scene."""
    scene, rigid = (fl.load_scene("single-link", changes) for changes in (SMALL, RIGID))
    return {
        "sweep": fl.sweep(scene, {"effects.payload.mass": [0.0, 0.02]}, 1e-5),
        "sensitivity": fl.sensitivity(scene, ["effects.payload.mass"], 1e-5),
        "audit": fl.audit(rigid),
        "cost": fl.cost(rigid, peers=False, seconds=0.3),
    }


KINDS = series_results, stability_results, arm_results, logged_results, answer_results


@cache
def public_results() -> dict[str, Any]:
    """All of them, by name."""
    return {name: made[name] for made in (kind() for kind in KINDS) for name in made}
