"""What accuracy costs in time: every stage of the work, at many settings, against a reference of higher precision."""

from flexlin.answers.accuracy.own_stages import cost
from flexlin.answers.accuracy.result import CostResult, Row

__all__ = ["CostResult", "Row", "cost"]
