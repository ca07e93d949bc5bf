"""Line charts as inline SVG: a few milliseconds each, colours from the page, text that can be read and searched."""

from flexlin.svg.layout import Row, draw
from flexlin.svg.panel import Panel, measure_text
from flexlin.svg.scales import Linear, Logarithmic, Named, Scale, Symlog

__all__ = ["Linear", "Logarithmic", "Named", "Panel", "Row", "Scale", "Symlog", "draw", "measure_text"]
