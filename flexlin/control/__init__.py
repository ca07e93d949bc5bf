"""Controllers for a periodic linear system: each design the same interface, each closed loop ready for Floquet's verdict.

What needs a manipulator, and with it CasADi, is loaded when it is first used.
"""

from importlib import import_module
from typing import Any

from flexlin.control.averaged import averaged_lqr
from flexlin.control.catalogue import design
from flexlin.control.designed_loop import Design
from flexlin.control.estimator import Estimator, kalman_filter, output_feedback
from flexlin.control.export import gain_schedule, periodic_plant, save, to_control
from flexlin.control.finite_horizon import finite_horizon_lqr
from flexlin.control.frozen import frozen_lqr
from flexlin.control.integral import with_integral_action
from flexlin.control.pd import pd_feedback
from flexlin.control.periodic import periodic_lqr
from flexlin.periodic.sampled.stability import sampled_floquet

_ON_MANIPULATORS = {
    "Feedforward": "flexlin.control.tracking",
    "bending": "flexlin.control.measurement",
    "joint_angles": "flexlin.control.measurement",
    "joint_rates": "flexlin.control.measurement",
    "tip_acceleration": "flexlin.control.measurement",
    "tip_position": "flexlin.control.measurement",
    "PeriodicMotion": "flexlin.about.periodic_motion",
    "feedforward": "flexlin.control.tracking",
    "Sensors": "flexlin.control.sensors",
    "scene_feedback": "flexlin.control.from_scene",
    "scene_sensors": "flexlin.control.sensors",
    "drive_load": "flexlin.control.drives",
    "estimator_source": "flexlin.control.export.c_estimator",
    "gain_source": "flexlin.control.export.c_gain",
    "horizon_system": "flexlin.control.horizon",
    "lifted_model": "flexlin.control.export.lifted",
    "linear_range": "flexlin.control.validity",
    "linearization_source": "flexlin.control.export.c_linearization",
    "linearize_about": "flexlin.about.elastic",
    "physical_weights": "flexlin.control.bryson",
    "periodic_motion": "flexlin.about.periodic_motion",
}

__all__ = [
    "Design",
    "Estimator",
    "averaged_lqr",
    "design",
    "finite_horizon_lqr",
    "frozen_lqr",
    "gain_schedule",
    "kalman_filter",
    "output_feedback",
    "pd_feedback",
    "periodic_lqr",
    "periodic_plant",
    "sampled_floquet",
    "save",
    "to_control",
    "with_integral_action",
    *_ON_MANIPULATORS,
]


def __getattr__(name: str) -> Any:
    if name not in _ON_MANIPULATORS:
        raise AttributeError(f"module 'flexlin.control' has no attribute {name!r}")
    return getattr(import_module(_ON_MANIPULATORS[name]), name)
