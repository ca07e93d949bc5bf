"""Assumed modes of a link and their integrals; numpy and scipy only."""

from flexlin.mechanics.beam.integrals import Profile, ShapeIntegrals, Shapes, shape_integrals
from flexlin.mechanics.beam.ritz import Ends, Section, finite_elements, tapered, twisted
from flexlin.mechanics.beam.uniform import clamped_free, clamped_with_tip, pinned_with_hub

__all__ = [
    "Ends",
    "Profile",
    "Section",
    "ShapeIntegrals",
    "Shapes",
    "clamped_free",
    "clamped_with_tip",
    "finite_elements",
    "pinned_with_hub",
    "shape_integrals",
    "tapered",
    "twisted",
]
