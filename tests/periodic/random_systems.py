"""Random periodic systems with exponents known without flexlin: `draw(kind, seed)` gives one, `KINDS` names them.

The truth of a transformed system is its constant matrix D; every other truth comes from extended precision (`truths.py`).
`doubt` bounds each truth's own error, the rounding of A(t) to doubles included: a claim is missed beyond claim + doubt only.
"""

from tests.periodic import boundary_systems, gentle, jumping_systems, non_normal_systems, transformed_systems
from tests.periodic.cases import KINDS, Case, draw

MAKERS = (transformed_systems, non_normal_systems, jumping_systems, boundary_systems, gentle)
"""Imported for the kinds that they register."""

COUNTS = {
    "rotation": 1500,
    "shear": 1500,
    "exponential": 1500,
    "mixed": 1500,
    "jordan": 1000,
    "multipliers 1e-300 to 1e300": 1000,
    "reparametrised": 1000,
    "kinks named": 500,
    "kinks not named": 500,
    "stiff": 500,
    "kept shapes": 1000,
    "waving shapes": 500,
    "uneven gaps": 300,
    "non-normal constant": 1000,
    "non-normal, f(t) C": 300,
    "non-normal rotated": 400,
    "non-normal switched": 300,
    "pulses": 1000,
    "jumps not named": 400,
    "jumps not named, smooth between": 500,
    "Meissner not named": 200,
    "jumps named": 200,
    "Mathieu": 300,
    "Krein": 200,
    "undamped oscillators": 300,
    "wrong period": 200,
    "fixed settings": 1000,
}
"""How many of each kind the whole jury hears."""

__all__ = ["COUNTS", "KINDS", "Case", "draw"]
