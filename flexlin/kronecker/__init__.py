"""The calculus of matrices by vectors in Kronecker layout (Khang, Dat, Tuan 2019; Vetter 1973).

The rules work on NumPy and CasADi matrices alike; CasADi is loaded only by those who use it.
"""

from importlib import import_module
from typing import Any

from flexlin.kronecker.algebra import kron, kronecker_power, swap
from flexlin.kronecker.expansion import bilinear_term, linearization, linearized_product, taylor_sum
from flexlin.kronecker.rules import chain_rule, inverse_rule, kronecker_rule, product_rule

__all__ = [
    "bilinear_term",
    "chain_rule",
    "derivative",
    "inverse_rule",
    "kron",
    "kronecker_power",
    "kronecker_rule",
    "linearization",
    "linearized_product",
    "product_rule",
    "swap",
    "taylor_sum",
]


def __getattr__(name: str) -> Any:
    if name == "derivative":
        return import_module("flexlin.kronecker.symbolic").derivative
    raise AttributeError(f"module 'flexlin.kronecker' has no attribute {name!r}")
