"""Periodic linear systems, numpy and scipy only: usable without any manipulator."""

from flexlin.periodic.batch import BatchResult, floquet_batch
from flexlin.periodic.floquet import floquet
from flexlin.periodic.forced import ForcedResponse, forced_response
from flexlin.periodic.modes import FloquetModes, floquet_modes
from flexlin.periodic.real_factor import RealFactor, real_factor
from flexlin.periodic.resonance import Resonance, resonances
from flexlin.periodic.result import FloquetResult
from flexlin.periodic.sensitivity import exponent_derivatives
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.tracking import tracked_frequencies

__all__ = [
    "BatchResult",
    "FloquetModes",
    "FloquetResult",
    "ForcedResponse",
    "PeriodicSystem",
    "RealFactor",
    "Resonance",
    "exponent_derivatives",
    "floquet",
    "floquet_batch",
    "floquet_modes",
    "forced_response",
    "real_factor",
    "resonances",
    "tracked_frequencies",
]
