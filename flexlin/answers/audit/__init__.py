"""Which effects and how many modes does a scene need?"""

from importlib import import_module
from typing import Any

_HOME = {
    "Audit": "flexlin.answers.audit.result",
    "Measure": "flexlin.answers.audit.figures",
    "Minimal": "flexlin.answers.audit.result",
    "Row": "flexlin.answers.audit.result",
    "audit": "flexlin.answers.audit.comparison",
    "measure": "flexlin.answers.audit.figures",
}
"""Where each public name stands; its module is loaded when it is first used."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'flexlin.answers.audit' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
