"""Which effects and how many modes does a scene need?"""

from flexlin.audit.audit import Audit, Row, audit
from flexlin.audit.measure import Measure, measure

__all__ = ["Audit", "Measure", "Row", "audit", "measure"]
