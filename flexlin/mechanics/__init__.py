"""The symbolic wing: equations of motion of planar chains with rigid and flexible links."""

from flexlin.mechanics.chain import build_manipulator
from flexlin.mechanics.effects import Effect, register_effect
from flexlin.mechanics.manipulator import Manipulator

__all__ = ["Effect", "Manipulator", "build_manipulator", "register_effect"]
