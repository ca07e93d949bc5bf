"""Which effects and how many modes does a scene need?"""

from flexlin.answers.audit.comparison import audit
from flexlin.answers.audit.figures import Measure, measure
from flexlin.answers.audit.result import Audit, Row

__all__ = ["Audit", "Measure", "Row", "audit", "measure"]
