"""Which effects and how many modes does a scene need?"""

from flexlin.answers.audit.comparison import Audit, Row, audit
from flexlin.answers.audit.figures import Measure, measure

__all__ = ["Audit", "Measure", "Row", "audit", "measure"]
