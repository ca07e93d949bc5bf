"""Taylor sums and linearizations: observed order of the remainder, and CasADi's Jacobians as the judge."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin.kronecker as kr
from flexlin.errors import ArgumentError
from tests.series.test_explicit import slope

RNG = np.random.default_rng(3)
W = [RNG.normal(size=(6, 2)) for _ in range(4)]


@pytest.fixture
def model():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 2)
    A = ca.reshape(ca.sin(W[0] @ x + W[1] @ y) + ca.exp(0.4 * (W[2] @ x)) * ca.cos(W[3] @ y), 3, 2)
    return x, y, A


@pytest.mark.parametrize("shape", [(1, 1), (3, 1), (3, 2)])
@pytest.mark.parametrize("order", range(5))
def test_remainder_of_taylor_sum_falls_with_order(model, shape, order):
    x, _, A = model
    A = ca.substitute(A, model[1], ca.DM([0.3, -0.2]))[: shape[0], : shape[1]]
    x0, angles = np.array([[0.5], [0.3]]), np.linspace(0, np.pi, 7)
    jets = [kr.derivative(A, x, k) for k in range(order + 1)]
    derivatives = [d.full() for d in ca.Function("jets", [x], jets).call([x0])]
    exact = ca.Function("A", [x], [A])

    def error(delta):
        return np.linalg.norm(kr.taylor_sum(derivatives, delta) - exact(x0 + delta).full())

    d = np.array([[0.05], [-0.11]])
    in_symbols = ca.Function("s", [x], [kr.taylor_sum(jets, ca.DM(d))])
    assert_allclose(in_symbols(x0).full(), kr.taylor_sum(derivatives, d), rtol=1e-13)
    steps = np.geomspace(0.01, 0.05, 5)
    errors = [max(error(h * np.array([[np.cos(a)], [np.sin(a)]])) for a in angles) for h in steps]
    assert abs(slope(errors, steps) - (order + 1)) < 0.25


def test_linearization_of_two_vectors_49_50(model):
    x, y, A = model
    x0, y0 = np.array([[0.2], [-0.4]]), np.array([[0.5], [0.1]])
    by_x, by_y = kr.derivative(A, x), kr.derivative(A, y)
    D = ca.Function("D", [x, y], [A, by_x, by_y, kr.derivative(by_y, x)])
    A0, DxA, DyA, DxDyA = (d.full() for d in D.call([x0, y0]))
    steps, linear, bilinear = np.geomspace(1e-3, 1e-2, 5), [], []
    for h in steps:
        dx, dy = h * np.array([[0.6], [0.8]]), h * np.array([[-1.0], [0.4]])
        corners = [D(x0 + i * dx, y0 + j * dy)[0].full() for i, j in ((1, 1), (1, 0), (0, 1))]
        linear.append(np.linalg.norm(corners[0] - kr.linearization(A0, (DxA, dx), (DyA, dy))))
        mixed = corners[0] - corners[1] - corners[2] + A0
        bilinear.append(np.linalg.norm(mixed - kr.bilinear_term(DxDyA, dx, dy)))
    assert abs(slope(linear, steps) - 2) < 0.05
    assert abs(slope(bilinear, steps) - 3) < 0.05


def test_linearized_product_52_is_the_jacobian(model):
    x, y, A = model
    point = [np.array([0.2, -0.4]), np.array([0.5, 0.1])]
    product = A @ y
    by_y, by_x = ca.Function("J", [x, y], [ca.jacobian(product, y), ca.jacobian(product, x)]).call(point)
    D = ca.Function("D", [x, y], [A, kr.derivative(A, y), kr.derivative(A, x), product])
    A0, DyA, DxA, value = (d.full() for d in D.call(point))
    result = kr.linearized_product(A0, point[1][:, None], DyA, DxA)
    assert_allclose(result.value, value, rtol=1e-14)
    assert_allclose(result.by_y, by_y.full(), rtol=1e-13)
    assert_allclose(result.by_x, by_x.full(), rtol=1e-13)

    symbolic = kr.linearized_product(A, y, kr.derivative(A, y), kr.derivative(A, x))
    for ours, numeric in zip(ca.Function("s", [x, y], list(symbolic)).call(point), result, strict=True):
        assert_allclose(ours.full(), numeric, rtol=1e-13)


def test_widths_that_do_not_fit_are_refused():
    with pytest.raises(ArgumentError, match="derivative 1"):
        kr.taylor_sum([np.eye(2), np.ones((2, 3))], np.ones((2, 1)))
    with pytest.raises(ArgumentError, match="columns"):
        kr.linearization(np.eye(2), (np.ones((2, 6)), np.ones((2, 1))))
