"""Periodic linear systems, numpy and scipy only: usable without any manipulator."""

from flexlin.periodic.batch import BatchResult, floquet_batch
from flexlin.periodic.floquet import FloquetResult, floquet
from flexlin.periodic.forced import ForcedResponse, forced_response
from flexlin.periodic.system import PeriodicSystem

__all__ = [
    "BatchResult",
    "FloquetResult",
    "ForcedResponse",
    "PeriodicSystem",
    "floquet",
    "floquet_batch",
    "forced_response",
]
