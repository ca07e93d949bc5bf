"""Which effects and how many modes does a scene need?"""

from flexlin.answers.audit.comparison import audit
from flexlin.answers.audit.figures import Measure, measure
from flexlin.answers.audit.result import Audit, Minimal, Row

__all__ = ["Audit", "Measure", "Minimal", "Row", "audit", "measure"]
