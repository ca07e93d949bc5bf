"""X' = T A X as fast as Python can hand it to an integrator: machine code, made from the equations."""

from collections.abc import Callable
from functools import lru_cache

import casadi as ca
import numpy as np

from flexlin.about.free import ParametricLoop
from flexlin.answers.peers.compiled import compile_function
from flexlin.checks import Array

Rate = Callable[[float, Array], Array]
"""(phase, columns of X one after another (n n,)) -> the columns of T A X."""


def derive_state_matrix(loop: ParametricLoop) -> ca.Function:
    """(phase, p) -> T A = T [0 I 0; -M^-1 [K, D]] as one expression, ignorable coordinates left out, time in units of the period."""
    phase, p = loop.matrices.sx_in()
    M, D, K = loop.matrices(phase, p)
    n = loop.coordinates - loop.memory
    lower = ca.ldl_solve(ca.horzcat(K[:, :n], D), *ca.ldl(ca.sparsify(M)))
    A = ca.vertcat(ca.horzcat(ca.SX.zeros(n, n), ca.SX.eye(n), ca.SX.zeros(n, loop.memory)), -lower)
    return ca.Function("state_matrix", [phase, p], [ca.densify(loop.duration(p) * A)], ["phase", "p"], ["A"])


def derive_product(loop: ParametricLoop) -> ca.Function:
    """(phase, columns of X, p) -> the columns of T A X, zeros of A left out of the product."""
    A = derive_state_matrix(loop)
    phase, p = A.sx_in()
    X = ca.SX.sym("X", A.size1_out(0), A.size1_out(0))
    product = ca.densify(ca.vec(ca.sparsify(A(phase, p)) @ X))
    return ca.Function("product", [phase, ca.vec(X), p], [product], ["phase", "X", "p"], ["rate"])


@lru_cache(maxsize=4)
def compile_product(loop: ParametricLoop) -> ca.Function:
    """The product as machine code where there is a compiler, kept for all tolerances."""
    product = derive_product(loop)
    return compile_function(product) or product


def prepare_rate(loop: ParametricLoop, p: Array) -> Rate:
    """The product for integrators that call Python."""
    return FastRate(compile_product(loop), p)


class FastRate:
    """(t, x, p) -> x' at fixed p through buffers that are laid out once.

    Each call returns an array of its own: integrators keep the last one.
    """

    def __init__(self, function: ca.Function, p: Array):
        self._function = function  # which must live as long as its buffers
        self._t, self._x, self._parameters = np.zeros(1), np.zeros(function.numel_in(1)), np.array(p, dtype=float)
        self._out = np.zeros(function.numel_out(0))
        self._buffer, self._trigger = self._function.buffer()
        for i, array in enumerate((self._t, self._x, self._parameters)):
            if array.size:
                self._buffer.set_arg(i, array.data)
        self._buffer.set_res(0, self._out.data)

    def __call__(self, t: float, x: Array) -> Array:
        self._t[0] = t
        self._x[:] = x
        self._trigger()
        return self._out.copy()
