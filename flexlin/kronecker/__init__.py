"""The calculus of matrices by vectors in Kronecker layout (Khang, Dat, Tuan 2019; Vetter 1973).

The rules work on NumPy and CasADi matrices alike; CasADi is loaded only by those who use it.
"""

from importlib import import_module
from typing import Any

_HOME = {
    "bilinear_term": "flexlin.kronecker.expansion",
    "chain_rule": "flexlin.kronecker.rules",
    "derivative": "flexlin.kronecker.symbolic",
    "inverse_rule": "flexlin.kronecker.rules",
    "kron": "flexlin.kronecker.algebra",
    "kronecker_power": "flexlin.kronecker.algebra",
    "kronecker_rule": "flexlin.kronecker.rules",
    "linearization": "flexlin.kronecker.expansion",
    "linearized_product": "flexlin.kronecker.expansion",
    "product_rule": "flexlin.kronecker.rules",
    "swap": "flexlin.kronecker.algebra",
    "taylor_sum": "flexlin.kronecker.expansion",
}
"""Where each public name stands; its module is loaded when it is first used."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'flexlin.kronecker' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
