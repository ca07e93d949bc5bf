"""Fast modes apart from slow ones: superadiabatic decoupling of periodic linear systems."""

from flexlin.periodic.decoupling.decouple import decouple
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.exponents import DecoupledExponents, decoupled_exponents

__all__ = ["Decoupled", "DecoupledExponents", "Refusal", "decouple", "decoupled_exponents"]
