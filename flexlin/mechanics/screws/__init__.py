"""Screws: twists, adjoint maps and products of exponentials, with all partial derivatives by multiplication alone."""

from flexlin.mechanics.screws.open_chain import OpenChain
from flexlin.mechanics.screws.twists import Ad, ad, exponential, hat, helical, prismatic, revolute, skew

__all__ = ["Ad", "OpenChain", "ad", "exponential", "hat", "helical", "prismatic", "revolute", "skew"]
