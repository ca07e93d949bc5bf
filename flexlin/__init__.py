"""flexlin: linearization, Floquet stability and control of light robot arms whose links bend.

The public names are loaded when they are first used, so that `import flexlin` stays light.
"""

import logging
from importlib import import_module
from typing import Any

__version__ = "0.2.0"
logging.getLogger(__name__).addHandler(logging.NullHandler())

_HOME = {
    "load_scene": "flexlin.scene",
    "parse_scene": "flexlin.scene",
    "scenes": "flexlin.scene",
    "scene_from_urdf": "flexlin.scene.loading",
    "Scene": "flexlin.scene",
    "build_manipulator": "flexlin.mechanics",
    "Manipulator": "flexlin.mechanics",
    "build_motion": "flexlin.motion",
    "linearize": "flexlin.about.linear",
    "Linearization": "flexlin.about.linear",
    "Trajectory": "flexlin.about.linear",
    "PeriodicFamily": "flexlin.about.family",
    "PeriodicStateSpace": "flexlin.periodic.related",
    "PeriodicSystem": "flexlin.periodic.system",
    "floquet": "flexlin.periodic.floquet.exponents",
    "FloquetResult": "flexlin.periodic.floquet.result",
    "floquet_modes": "flexlin.periodic.floquet.modes",
    "invariant_zeros": "flexlin.periodic.zeros",
    "h2_norm": "flexlin.periodic.norms",
    "hinf_norm": "flexlin.periodic.norms",
    "margins": "flexlin.periodic.margins",
    "frequency_response": "flexlin.periodic.response.frequency",
    "output_lqr": "flexlin.control.output_lqr",
    "forced_response": "flexlin.periodic.response.forced",
    "periodic_lqr": "flexlin.control",
    "periodic_lyapunov": "flexlin.periodic.quadratic.riccati",
    "respond": "flexlin.periodic.response.transient",
    "sampled_estimator": "flexlin.control.sampled",
    "sampled_lqr": "flexlin.control.sampled",
    "simulate": "flexlin.simulation",
    "sweep": "flexlin.answers.sweep",
    "critical_values": "flexlin.answers.critical_values",
    "nearest_instability": "flexlin.answers.nearest",
    "stability_boundary": "flexlin.answers.stability_boundary",
    "tune": "flexlin.answers.tuning",
    "sensitivity": "flexlin.answers.sensitivity",
    "audit": "flexlin.answers.audit",
    "cost": "flexlin.answers.accuracy",
    "Log": "flexlin.identification.log",
    "read_log": "flexlin.identification.reading",
    "identify": "flexlin.identification.maximum_likelihood",
    "predict": "flexlin.identification.prediction",
    "taylor": "flexlin.series",
    "TaylorMap": "flexlin.series",
    "implicit_taylor": "flexlin.series",
}
"""Where each public function and class stands."""
_MODULES = {
    "control": "flexlin.control",
    "errors": "flexlin.errors",
    "kronecker": "flexlin.kronecker",
    "plots": "flexlin.plots",
    "screws": "flexlin.mechanics.screws",
}
"""Modules that are public as a whole."""

__all__ = sorted([*_HOME, *_MODULES])


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
    elif name in _MODULES:
        value = import_module(_MODULES[name])
    else:
        raise AttributeError(f"module 'flexlin' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
