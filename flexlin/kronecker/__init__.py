"""The calculus of matrices by vectors in Kronecker layout (Khang, Dat, Tuan 2019; Vetter 1973).

The rules work on NumPy and CasADi matrices alike; CasADi is loaded only by those who use it.
"""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
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
    },
)
