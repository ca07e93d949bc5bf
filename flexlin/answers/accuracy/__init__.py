"""What accuracy costs in time: every stage of the work, at many settings, against a reference of higher precision."""

from flexlin.answers.accuracy.result import CostResult, Row
from flexlin.answers.accuracy.work_precision import cost

__all__ = ["CostResult", "Row", "cost"]
