"""flexlin: linearization, Floquet stability and control of light robot arms whose links bend.

The public names are loaded when they are first used, so that `import flexlin` stays light.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "load_scene": "flexlin.scene",
    "Scene": "flexlin.scene",
    "build_manipulator": "flexlin.mechanics",
    "Manipulator": "flexlin.mechanics",
    "linearize": "flexlin.linearization",
    "Linearization": "flexlin.linearization",
    "PeriodicSystem": "flexlin.periodic",
    "floquet": "flexlin.periodic",
    "forced_response": "flexlin.periodic",
    "periodic_lqr": "flexlin.control",
    "taylor": "flexlin.series",
    "TaylorMap": "flexlin.series",
    "implicit_taylor": "flexlin.series",
}
_MODULES = (
    "audit",
    "control",
    "cost",
    "errors",
    "kronecker",
    "linearization",
    "mechanics",
    "motion",
    "periodic",
    "scene",
    "screws",
    "sensitivity",
    "series",
    "simulation",
    "sweep",
)

__all__ = [*_HOME, *_MODULES]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
    elif name == "screws":
        value = import_module("flexlin.mechanics.screws")
    elif name in _MODULES:
        value = import_module(f"flexlin.{name}")
    else:
        raise AttributeError(f"module 'flexlin' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
