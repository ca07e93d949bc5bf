"""Taylor maps of explicit and implicit functions to any order, with their error, radius and linear range."""

from flexlin.series.explicit import TaylorMap, taylor
from flexlin.series.implicit import implicit_taylor
from flexlin.series.implicit_map import ImplicitMap
from flexlin.series.radius import Radius
from flexlin.series.solution import solve_implicit
from flexlin.series.unroll import c_code

__all__ = ["ImplicitMap", "Radius", "TaylorMap", "c_code", "implicit_taylor", "solve_implicit", "taylor"]
