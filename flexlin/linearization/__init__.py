"""The linearization of a manipulator about its motion: in symbols, and as the linear system that the numeric wing takes."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "linearization.harmonic_balance": "balance by_law miss_between Solver",
        "linearization.free": "make_kernel parametric_loop ParametricLoop record_model",
        "linearization.law": "Law",
        "linearization.layers": "Layers saturating_arguments",
        "linearization.linear": "by_jacobian by_kronecker with_control",
    },
)
