"""One of each public result, of small scenes: what the tests of pickling and of `repr` go through."""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np

import flexlin as fl
from flexlin.about.free import parametric_loop
from flexlin.control import (
    averaged_lqr,
    feedforward,
    finite_horizon_lqr,
    frozen_lqr,
    kalman_filter,
    linear_range,
    linearize_about,
    output_feedback,
    pd_feedback,
    periodic_lqr,
    periodic_motion,
    tip_acceleration,
    tip_position,
    with_integral_action,
)
from flexlin.periodic.floquet.resonance import find_resonances
from flexlin.periodic.quadratic.riccati import finite_horizon_riccati, periodic_lyapunov, periodic_riccati
from flexlin.scene.estimator import EstimatorTable
from flexlin.series import solve_implicit
from flexlin.simulation import region_of_attraction

SMALL = {"links.0.modes": 1, "designs": []}


def swinging(t: np.ndarray) -> np.ndarray:
    """The stiffness of Mathieu's equation."""
    return (1.0 + 0.5 * np.cos(2 * t))[:, None, None]


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
def stability_results() -> dict[str, Any]:
    """Answers about Mathieu's equation inside its first tongue, about weights, and about forces."""
    system = fl.PeriodicSystem.from_second_order(np.eye(1), 0.1 * np.eye(1), swinging, np.pi, B=np.eye(1))
    result = fl.floquet(system, tol=1e-7)
    modes = fl.floquet_modes(system, result)
    riccati = periodic_riccati(system, np.eye(2), np.eye(1), tol=1e-7)
    return {
        "system": system,
        "floquet": result,
        "modes": modes,
        "resonance": find_resonances(system, modes)[0],
        "riccati": riccati,
        "lyapunov": periodic_lyapunov(system.feedback(riccati.K), np.eye(2), tol=1e-6),
        "horizon": finite_horizon_riccati(system, np.eye(2), np.eye(1), np.eye(2), tol=1e-7),
        "forced": fl.forced_response(system, [0.0, 1.0], tol=1e-7),
        "h2": fl.h2_norm(system.feedback(riccati.K), np.eye(2)),
        "tuning": fl.tune(
            lambda gain: fl.PeriodicSystem([[0.0, 1.0], [-1.0, -gain]], 1.0), {"gain": 0.3}, starts=1, steps=1
        ),
        "critical": fl.critical_values(
            lambda d: fl.PeriodicSystem([[0.0, 1.0], [-1.0, -d]], 1.0), "d", (-0.1, 0.2), samples=9
        )[0],
        "boundary": fl.stability_boundary(
            lambda d, k: fl.PeriodicSystem([[0.0, 1.0], [-k, -d]], 1.0), {"d": (-0.1, 0.2), "k": (1.0, 2.0)}
        )[0],
        "margins": fl.margins(fl.PeriodicSystem([[0.0]], 1.0, B=[[1.0]]), [[2.0]]),
        "hinf": fl.hinf_norm(fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]]), [[1.0]]),
    }


@cache
def arm_results() -> dict[str, Any]:
    """What is made of one scene, from its arm to the region of attraction."""
    scene = fl.load_scene("single-link", SMALL)
    arm = fl.build_manipulator(scene)
    plant, lin = fl.linearize(arm, scene.motion), fl.linearize(arm, scene.motion, scene.control)
    system = plant.periodic_system()
    weights = np.diag([1.0, 1.0, 0.01, 0.01]), 100 * np.eye(1)
    lqr = periodic_lqr(system, *weights, tol=1e-7)
    filtered = kalman_filter(system, fl.control.joint_angles(plant), 0.1 * np.eye(4), 1e-4 * np.eye(1), tol=1e-6)
    elastic = periodic_motion(lin)
    T = np.linspace(0.0, lin.period, 8, endpoint=False)
    return {
        "scene": scene,
        "arm": arm,
        "motion": fl.build_motion(scene.motion, arm.joints),
        "linearization": lin,
        "coefficients": lin.sample(np.array([0.1, 0.2])),
        "deviation": lin.about,
        "law": lin.law,
        "parametric": parametric_loop(scene, ["effects.payload.mass"]),
        "periodic": lqr,
        "frozen": frozen_lqr(system, *weights, phases=4),
        "averaged": averaged_lqr(system, *weights),
        "finite horizon": finite_horizon_lqr(system, *weights, tol=1e-6),
        "pd": pd_feedback(system, [0], [10.0], [1.0]),
        "estimator": filtered,
        "drive load": fl.control.drive_load(lin, T, np.zeros((len(T), 4)), lin.law),
        "sensors": fl.control.scene_sensors(scene, plant, EstimatorTable(encoders=1e-4, tip=1e-3, torque=0.01)),
        "loop": output_feedback(lqr, filtered),
        "integral": with_integral_action(system, np.eye(1, 4)),
        "elastic motion": elastic,
        "about it": linearize_about(elastic),
        "feedforward": feedforward(lin, "tip-exact"),
        "its law": feedforward(lin, "joint-exact").law,
        "response": fl.forced_response(lin.periodic_system(), lin.forcing, tol=1e-7),
        "camera": tip_position(lin),
        "accelerometer": tip_acceleration(lin)[0],
        "range": linear_range(lin),
        "simulation": fl.simulate(lin, 0.1),
        "attraction": region_of_attraction(lin, modes=1, periods=1.0, halvings=1, tol=1e-4),
    }


@cache
def answer_results() -> dict[str, Any]:
    """Sweep, sensitivities, audit and cost of one scene."""
    scene = fl.load_scene("single-link", SMALL)
    return {
        "sweep": fl.sweep(scene, {"effects.payload.mass": [0.0, 0.02]}, 1e-5),
        "sensitivity": fl.sensitivity(scene, ["effects.payload.mass"], 1e-5),
        "audit": fl.audit(scene),
        "cost": fl.cost(scene, peers=False),
    }


@cache
def public_results() -> dict[str, Any]:
    """All of them, by name."""
    return {**series_results(), **stability_results(), **arm_results(), **answer_results()}
