"""The full nonlinear closed loop: the judge of every linear answer."""

from importlib import import_module
from typing import Any

_HOME = {
    "Attraction": "flexlin.simulation.attraction",
    "Drive": "flexlin.simulation.drive",
    "NonlinearLoop": "flexlin.simulation.loop",
    "Simulation": "flexlin.simulation.result",
    "check_duration": "flexlin.simulation.run",
    "predict": "flexlin.simulation.prediction",
    "region_of_attraction": "flexlin.simulation.attraction",
    "simulate": "flexlin.simulation.run",
    "tip_positions": "flexlin.control.tracking",
}
"""Where each public name stands; its module is loaded when it is first used."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'flexlin.simulation' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
