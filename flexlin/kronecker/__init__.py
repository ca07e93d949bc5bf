"""The calculus of matrices by vectors in Kronecker layout (Khang, Dat, Tuan 2019; Vetter 1973).

The rules work on NumPy and CasADi matrices alike; CasADi is loaded only by those who use it.
"""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "kronecker.algebra": "chain_rule inverse_rule kron kronecker_power kronecker_rule product_rule swap "
        "bilinear_term linearization linearized_product taylor_sum",
        "kronecker.symbolic": "derivative",
    },
)
