"""Fast modes apart from slow ones: superadiabatic decoupling of periodic linear systems."""

from flexlin.periodic.decoupling.decouple import decouple, decoupling_work
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.exponents import DecoupledExponents, decoupled_exponents
from flexlin.periodic.decoupling.panels import panel_exponents

__all__ = [
    "Decoupled",
    "DecoupledExponents",
    "Refusal",
    "decouple",
    "decoupled_exponents",
    "decoupling_work",
    "panel_exponents",
]
