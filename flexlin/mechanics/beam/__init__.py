"""Assumed modes of a link and their integrals; numpy and scipy only."""

from flexlin.mechanics.beam.clamped import clamped_free, clamped_with_tip
from flexlin.mechanics.beam.integrals import ShapeIntegrals, shape_integrals
from flexlin.mechanics.beam.pinned import pinned_free, pinned_with_hub
from flexlin.mechanics.beam.profile import Profile
from flexlin.mechanics.beam.ritz import Ends, Section, finite_elements, tapered
from flexlin.mechanics.beam.shapes import Shapes
from flexlin.mechanics.beam.twist import twisted

__all__ = [
    "Ends",
    "Profile",
    "Section",
    "ShapeIntegrals",
    "Shapes",
    "clamped_free",
    "clamped_with_tip",
    "finite_elements",
    "pinned_free",
    "pinned_with_hub",
    "shape_integrals",
    "tapered",
    "twisted",
]
