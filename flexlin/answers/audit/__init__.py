"""Which effects and how many modes does a scene need?"""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "answers.audit.comparison": "audit",
        "answers.audit.figures": "Measure measure",
        "answers.audit.result": "Audit Minimal Row",
    },
)
