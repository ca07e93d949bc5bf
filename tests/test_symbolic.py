"""The door between CasADi and NumPy: values, layout, and refusal of anything that would be broadcast."""

import casadi as ca
import numpy as np
import pytest

from flexlin import symbolic
from flexlin.errors import ArgumentError


@pytest.fixture
def function():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    return ca.Function("f", [x, y], [ca.horzcat(x, y * x, ca.sin(x)), x[0] + y])


def test_values_and_layout(function):
    x, y = np.random.default_rng(1).normal(size=(2, 7, 2))[0], np.arange(7.0)[:, None]
    matrix, scalar = symbolic.evaluate(function, x, y)
    np.testing.assert_allclose(matrix, np.stack([x, y * x, np.sin(x)], axis=2), rtol=1e-15)
    np.testing.assert_allclose(scalar[:, 0, 0], x[:, 0] + y[:, 0], rtol=1e-15)


def test_chunks_join(function, monkeypatch):
    x, y = np.ones((10, 2)), np.arange(10.0)[:, None]
    whole = symbolic.evaluate(function, x, y)
    monkeypatch.setattr(symbolic, "CHUNK_POINTS", 3)
    for a, b in zip(whole, symbolic.evaluate(function, x, y), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("x", "y"), [((4, 2), (1, 1)), ((4, 1), (4, 1)), ((0, 2), (0, 1)), ((4, 2), (4, 1))], ids=str)
def test_nothing_is_broadcast_and_numbers_are_finite(function, x, y):
    with pytest.raises(ArgumentError):
        symbolic.evaluate(function, np.full(x, np.nan if y == (4, 1) else 1.0), np.ones(y))


def test_sparse_outputs_are_refused():
    x = ca.SX.sym("x", 2)
    with pytest.raises(ArgumentError, match="sparse"):
        symbolic.evaluate(ca.Function("f", [x], [ca.diag(x)]), np.ones((3, 2)))


def test_point_by_point_equals_the_batch(function):
    x, y = np.random.default_rng(2).normal(size=(5, 2)), np.arange(5.0)[:, None]
    for one, rows in enumerate(zip(*symbolic.evaluate(function, x, y), strict=True)):
        for now, row in zip(symbolic.call_at(function, x[one], y[one]), rows, strict=True):
            np.testing.assert_array_equal(now, row)
