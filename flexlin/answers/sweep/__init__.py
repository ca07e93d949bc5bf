"""Stability over many values of scene parameters. The public names are loaded when they are first used: workers need few of them."""

from importlib import import_module
from typing import Any

_HOME = {"check_values": "axes", "worst_error": "found", "sweep": "run"}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
