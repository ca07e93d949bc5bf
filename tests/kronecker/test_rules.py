"""The Kronecker calculus: rules, sums and linearizations against CasADi's derivatives."""

import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin.kronecker as kr
from flexlin.errors import ArgumentError


def normal(*shape, seed=0):
    return np.random.default_rng([seed, *shape]).normal(size=shape)


def polynomial_matrix(x, m, p, seed):
    """A matrix of x that is nonlinear in every entry."""
    n = x.shape[0]
    W, V = normal(m * p, n, seed=seed), normal(m * p, n, seed=seed + 1)
    return ca.reshape(ca.sin(W @ x) + (V @ x) ** 2 + ca.exp(0.3 * W @ x), m, p)


def numbers(x, x0, *expressions):
    return [value.full() for value in ca.Function("f", [x], list(expressions)).call([x0])]


@pytest.mark.parametrize(("m", "p", "s", "n"), [(2, 3, 2, 3), (1, 2, 4, 2), (3, 1, 1, 4), (2, 2, 2, 1)])
def test_rules_against_casadi_derivatives(m, p, s, n):
    """Of numbers and of symbols."""
    x, x0 = ca.SX.sym("x", n), normal(n, 1, seed=5)
    A, B = polynomial_matrix(x, m, p, 10), polynomial_matrix(x, p, s, 20)
    symbols = A, kr.derivative(A, x), B, kr.derivative(B, x)
    values = numbers(x, x0, *symbols)
    for rule, made in ((kr.product_rule, A @ B), (kr.kronecker_rule, ca.kron(A, B))):
        expected, symbolic = numbers(x, x0, kr.derivative(made, x), rule(*symbols))
        assert_allclose(rule(*values), expected, rtol=1e-12, atol=1e-13)
        assert_allclose(symbolic, expected, rtol=1e-12, atol=1e-13)


def test_chain_and_inverse_rules():
    c, b = ca.SX.sym("c", 2), ca.SX.sym("b", 3)
    A = polynomial_matrix(b, 3, 3, 50) + 5 * ca.DM.eye(3)
    inner = polynomial_matrix(c, 3, 1, 60)
    c0 = normal(2, 1, seed=9)
    DcA = kr.derivative(ca.substitute(A, b, inner), c)
    inner0, Db = numbers(c, c0, inner, kr.derivative(inner, c))
    a, DbA = numbers(b, inner0, A, kr.derivative(A, b))
    assert_allclose(kr.chain_rule(DbA, Db), numbers(c, c0, DcA)[0], rtol=1e-11, atol=1e-12)
    (D_inverse,) = numbers(b, inner0, kr.derivative(ca.inv(A), b))
    assert_allclose(kr.inverse_rule(np.linalg.inv(a), DbA), D_inverse, rtol=1e-9, atol=1e-11)
    symbolic = kr.inverse_rule(ca.inv(A), kr.derivative(A, b))
    assert_allclose(numbers(b, inner0, symbolic)[0], D_inverse, rtol=1e-9, atol=1e-11)


I2 = np.eye(2)
UNFIT = {
    "DB": lambda: kr.product_rule(I2, np.ones((2, 4)), I2, np.ones((2, 6))),
    "does not fit A": lambda: kr.kronecker_rule(I2, np.ones((2, 3)), I2, np.ones((2, 4))),
    "factor": lambda: kr.kronecker_power(I2, 0),
    "derivative 1": lambda: kr.taylor_sum([I2, np.ones((2, 3))], np.ones((2, 1))),
    "columns": lambda: kr.linearization(I2, (np.ones((2, 6)), np.ones((2, 1)))),
}


@pytest.mark.parametrize("words", UNFIT)
def test_shapes_that_do_not_fit_are_refused(words):
    with pytest.raises(ArgumentError, match=words):
        UNFIT[words]()


def test_numpy_side_leaves_casadi_unloaded():
    use = "k.taylor_sum([np.eye(2), np.ones((2, 4))], np.ones((2, 1)))"
    script = f"import sys, numpy as np, flexlin.kronecker as k; {use}; assert 'casadi' not in sys.modules"
    subprocess.run([sys.executable, "-c", script], check=True)


RNG = np.random.default_rng(3)
W = [RNG.normal(size=(6, 2)) for _ in range(4)]


@pytest.fixture
def model():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 2)
    A = ca.reshape(ca.sin(W[0] @ x + W[1] @ y) + ca.exp(0.4 * (W[2] @ x)) * ca.cos(W[3] @ y), 3, 2)
    return x, y, A


def test_linearization_of_two_vectors_49_50(model):
    """Both terms by directional derivatives."""
    x, y, A = model
    dx, dy = np.array([[0.6], [0.8]]), np.array([[-1.0], [0.4]])
    along_x, along_y = (ca.reshape(ca.jtimes(ca.vec(A), z, dz), 3, 2) for z, dz in ((x, dx), (y, dy)))
    mixed = ca.reshape(ca.jtimes(ca.vec(along_y), x, dx), 3, 2)
    by_x, by_y = kr.derivative(A, x), kr.derivative(A, y)
    parts = [A, by_x, by_y, kr.derivative(by_y, x), A + along_x + along_y, mixed]
    found = ca.Function("D", [x, y], parts).call([[0.2, -0.4], [0.5, 0.1]])
    A0, DxA, DyA, DxDyA, linear, bilinear = (part.full() for part in found)
    assert_allclose(kr.linearization(A0, (DxA, dx), (DyA, dy)), linear, rtol=1e-13)
    assert_allclose(kr.bilinear_term(DxDyA, dx, dy), bilinear, rtol=1e-12)


def test_linearized_product_52_is_the_jacobian(model):
    """Of numbers and of symbols."""
    x, y, A = model
    point, by_y, by_x = [np.array([0.2, -0.4]), np.array([0.5, 0.1])], kr.derivative(A, y), kr.derivative(A, x)
    symbolic, product = kr.linearized_product(A, y, by_y, by_x), A @ y
    parts = [A, by_y, by_x, *symbolic, product, ca.jacobian(product, y), ca.jacobian(product, x)]
    A0, DyA, DxA, *found = (part.full() for part in ca.Function("D", [x, y], parts).call(point))
    result = kr.linearized_product(A0, point[1][:, None], DyA, DxA)
    for numeric, of_symbols, judge in zip((result.value, result.by_y, result.by_x), found[:3], found[3:], strict=True):
        assert_allclose(numeric, judge, rtol=1e-13)
        assert_allclose(of_symbols, judge, rtol=1e-13)
