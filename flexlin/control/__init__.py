"""Controllers for a periodic linear system: each design the same interface, each closed loop ready for Floquet's verdict.

What is asked for is loaded when it is first used, and CasADi only with what needs a manipulator.
"""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "Design": "flexlin.control.designed_loop",
        "Estimator": "flexlin.control.estimator",
        "Feedforward": "flexlin.control.tracking",
        "PeriodicMotion": "flexlin.about.periodic_motion",
        "Sensors": "flexlin.control.sensors",
        "averaged_lqr": "flexlin.control.averaged",
        "bending": "flexlin.control.measurement",
        "design": "flexlin.control.catalogue",
        "drive_load": "flexlin.control.drives",
        "estimator_source": "flexlin.control.export.c_estimator",
        "feedforward": "flexlin.control.tracking",
        "finite_horizon_lqr": "flexlin.control.finite_horizon",
        "frozen_lqr": "flexlin.control.frozen",
        "gain_schedule": "flexlin.control.export.python_control",
        "gain_source": "flexlin.control.export.c_gain",
        "horizon_system": "flexlin.control.horizon",
        "joint_angles": "flexlin.control.measurement",
        "joint_rates": "flexlin.control.measurement",
        "kalman_filter": "flexlin.control.estimator",
        "lifted_model": "flexlin.control.export.lifted",
        "linear_range": "flexlin.control.validity",
        "linearization_source": "flexlin.control.export.c_linearization",
        "linearize_about": "flexlin.about.elastic",
        "output_feedback": "flexlin.control.estimator",
        "pd_feedback": "flexlin.control.pd",
        "periodic_lqr": "flexlin.control.periodic",
        "periodic_motion": "flexlin.about.periodic_motion",
        "periodic_plant": "flexlin.control.export.python_control",
        "physical_weights": "flexlin.control.bryson",
        "sampled_floquet": "flexlin.periodic.sampled.stability",
        "save": "flexlin.control.export.files",
        "scene_feedback": "flexlin.control.from_scene",
        "scene_sensors": "flexlin.control.sensors",
        "tip_acceleration": "flexlin.control.measurement",
        "tip_position": "flexlin.control.measurement",
        "to_control": "flexlin.control.export.python_control",
        "with_integral_action": "flexlin.control.integral",
    },
)
