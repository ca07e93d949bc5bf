"""Designs for other tools: python-control systems, C source, MATLAB, netCDF and NumPy files."""

from flexlin.control.export.files import save
from flexlin.control.export.python_control import gain_schedule, periodic_plant, to_control

__all__ = ["gain_schedule", "periodic_plant", "save", "to_control"]
