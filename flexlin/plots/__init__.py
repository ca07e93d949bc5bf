"""What a result looks like: one description, drawn by matplotlib, as a card in a notebook, or said in words."""

from importlib import import_module
from typing import Any

__all__ = ["Comparison", "compare", "plot_chart"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'flexlin.plots' has no attribute {name!r}")
    return getattr(import_module("flexlin.plots.comparison"), name)


def __dir__() -> list[str]:
    return __all__
