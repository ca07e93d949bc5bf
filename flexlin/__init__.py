"""flexlin: linearization, Floquet stability and control of light robot arms whose links bend.

The public names are loaded when they are first used, so that `import flexlin` stays light.
"""

import logging

from flexlin.lazy import load_lazily

__version__ = "0.2.0"
logging.getLogger(__name__).addHandler(logging.NullHandler())

__getattr__, _, __all__ = load_lazily(
    __name__,
    {
        "linearization.family": "PeriodicFamily",
        "linearization.linear": "Linearization linearize Trajectory",
        "analyses.accuracy": "cost",
        "analyses.audit": "audit",
        "analyses.boundary": "critical_values stability_boundary",
        "analyses.log_effects": "select_effects",
        "analyses.nearest": "nearest_instability",
        "analyses.sensitivity": "sensitivity",
        "analyses.sweep.job": "sweep",
        "analyses.tuning": "tune",
        "control": "periodic_lqr",
        "control.output_lqr": "output_lqr",
        "control.sampled": "sampled_estimator sampled_lqr",
        "identification.log": "Log read_log",
        "identification.maximum_likelihood": "identify",
        "identification.prediction": "predict",
        "mechanics": "build_manipulator Manipulator",
        "motion": "build_motion",
        "periodic.floquet.exponents": "floquet",
        "periodic.floquet.modes": "floquet_modes",
        "periodic.floquet.result": "FloquetResult",
        "periodic.margins": "margins",
        "periodic.norms": "h2_norm hinf_norm",
        "periodic.riccati.riccati": "periodic_lyapunov",
        "periodic.related": "PeriodicStateSpace",
        "periodic.response.forced": "forced_response",
        "periodic.response.frequency": "frequency_response",
        "periodic.response.transient": "respond",
        "periodic.system": "PeriodicSystem",
        "periodic.zeros": "invariant_zeros",
        "scene": "load_scene parse_scene Scene scenes",
        "scene.loading": "scene_from_urdf",
        "series": "implicit_taylor taylor TaylorMap",
        "simulation": "simulate",
    },
    whole=("control", "errors", "kronecker", "plots", "mechanics.screws"),
)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
