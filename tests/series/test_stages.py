"""Series of an expression are held while they are read: the memory does not grow with its length."""

import tracemalloc

import casadi as ca
import numpy as np
import pytest

import flexlin as fl


def chain(x, factors):
    """A product of sines, roots, quotients and angles of all variables."""
    result, rng = 1.0, np.random.default_rng(2)
    for k in range(factors):
        y = ca.dot(ca.DM(rng.normal(size=x.numel())), x)
        result = result * [ca.sin(y) + 1.5, ca.sqrt(2 + ca.cos(y)), 1 / (3 + y * y), 1 + ca.atan2(y, 2 + y)][k % 4]
    return result


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length():
    x, order = ca.SX.sym("x", 5), 8
    fl.taylor(chain(x, 32), x, np.zeros(5) + 0.1, order)  # tables are kept
    peaks = []
    for factors in (8, 32):
        A = chain(x, factors)
        tracemalloc.start()
        P = fl.taylor(A, x, np.zeros(5) + 0.1, order)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.3 * peaks[0] + 2**17  # the longer program itself
    h = 0.003 * np.cos(np.arange(5))
    assert abs(P(h).item() / float(ca.Function("f", [x], [A])(0.1 + h)) - 1) < 1e-11
