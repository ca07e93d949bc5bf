"""The symbolic wing: equations of motion of chains with rigid and flexible links.

The builder and the manipulator are loaded when they are first used: a scene only needs to know the effects.
"""

from typing import TYPE_CHECKING

from flexlin.lazy import load_lazily
from flexlin.mechanics.effects import Effect, register_effect

if TYPE_CHECKING:
    from flexlin.mechanics.chain import build_manipulator
    from flexlin.mechanics.manipulator import Manipulator

__all__ = ["Effect", "Manipulator", "build_manipulator", "register_effect"]

__getattr__ = load_lazily(
    __name__, {"build_manipulator": "flexlin.mechanics.chain", "Manipulator": "flexlin.mechanics.manipulator"}
)[0]
