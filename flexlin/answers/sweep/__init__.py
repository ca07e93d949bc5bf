"""Stability over many values of scene parameters."""

from flexlin.answers.sweep.axes import check_values
from flexlin.answers.sweep.found import worst_error
from flexlin.answers.sweep.run import sweep

__all__ = ["check_values", "sweep", "worst_error"]
