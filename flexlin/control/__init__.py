"""Controllers for a periodic linear system: each design the same interface, each closed loop ready for Floquet's verdict.

What is asked for is loaded when it is first used, and CasADi only with what needs a manipulator.
"""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "linearization.periodic_motion": "linearize_about periodic_motion PeriodicMotion",
        "control.catalogue": "design physical_weights",
        "control.designed_loop": "Design pd_feedback scene_feedback",
        "control.drives": "drive_load",
        "control.estimator": "Estimator kalman_filter output_feedback",
        "control.export.c_source": "estimator_source gain_source linearization_source",
        "control.export.files": "save",
        "control.export.python_control": "gain_schedule lifted_model periodic_plant to_control",
        "control.frozen": "averaged_lqr frozen_lqr",
        "control.lqr": "finite_horizon_lqr horizon_system periodic_lqr with_integral_action",
        "control.sensors": "bending joint_angles joint_rates scene_sensors Sensors tip_acceleration tip_position",
        "control.tracking": "Feedforward feedforward",
        "control.validity": "linear_range",
        "periodic.sampled": "sampled_floquet",
    },
)
