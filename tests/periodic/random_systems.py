"""Random periodic systems with exponents known without flexlin: `draw(kind, seed)` gives one, `KINDS` names them.

The truth of a transformed system is its constant matrix D; every other truth comes from extended precision (`truths.py`).
`doubt` bounds each truth's own error, the rounding of A(t) to doubles included: a claim is missed beyond claim + doubt only.
"""

from tests.periodic import boundary_systems, jumping_systems, non_normal_systems, rotated, transformed_systems
from tests.periodic.cases import COUNTS, KINDS, Case, draw

MAKERS = (transformed_systems, non_normal_systems, jumping_systems, boundary_systems, rotated)
"""Imported for the kinds that they register."""

__all__ = ["COUNTS", "KINDS", "Case", "draw"]
