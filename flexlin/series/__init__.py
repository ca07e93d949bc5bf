"""Taylor maps of explicit and implicit functions to any order, with their error, radius and linear range."""

from importlib import import_module
from typing import Any

_HOME = {
    "ImplicitMap": "flexlin.series.implicit_map",
    "Radius": "flexlin.series.radius",
    "TaylorMap": "flexlin.series.explicit",
    "c_code": "flexlin.series.unroll",
    "implicit_taylor": "flexlin.series.implicit",
    "solve_implicit": "flexlin.series.solution",
    "taylor": "flexlin.series.explicit",
}
"""Where each public name stands; its module is loaded when it is first used."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'flexlin.series' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
