"""Stability over many values of scene parameters. The public names are loaded when they are first used: workers need few of them."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "analyses.sweep.found": "worst_error",
        "analyses.sweep.job": "check_values sweep",
    },
)
