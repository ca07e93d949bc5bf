"""Screws: twists, adjoint maps and products of exponentials, with all partial derivatives by multiplication alone."""

from flexlin.mechanics.screws.open_chain import OpenChain
from flexlin.mechanics.screws.twists import Ad, ad, cross, exponential, hat, helical, prismatic, revolute

__all__ = ["Ad", "OpenChain", "ad", "cross", "exponential", "hat", "helical", "prismatic", "revolute"]
