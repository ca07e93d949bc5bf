"""The symbolic wing: equations of motion of chains with rigid and flexible links.

The builder and the manipulator are loaded when they are first used: a scene only needs to know the effects.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from flexlin.mechanics.effects import Effect, register_effect

if TYPE_CHECKING:
    from flexlin.mechanics.chain import build_manipulator
    from flexlin.mechanics.manipulator import Manipulator

__all__ = ["Effect", "Manipulator", "build_manipulator", "register_effect"]

_HOME = {"build_manipulator": "flexlin.mechanics.chain", "Manipulator": "flexlin.mechanics.manipulator"}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'flexlin.mechanics' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
