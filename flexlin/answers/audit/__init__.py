"""Which effects and how many modes does a scene need?"""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "Audit": "flexlin.answers.audit.result",
        "Measure": "flexlin.answers.audit.figures",
        "Minimal": "flexlin.answers.audit.result",
        "Row": "flexlin.answers.audit.result",
        "audit": "flexlin.answers.audit.comparison",
        "measure": "flexlin.answers.audit.figures",
    },
)
