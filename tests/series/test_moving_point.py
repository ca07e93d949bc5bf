"""Straight-line code of implicit maps whose equations hold every elementary function: the map of its point, and of others."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin as fl
from flexlin.series import solve_implicit
from flexlin.series.jets import binary, unary

from .test_explicit import OPERATIONS, X

ORDER = 6
U, V = X[0], X[1]
HERE, THERE = 0.3, 0.38
"""Where a map is made, and where its moving form is asked."""


def equation(name):
    """v + 0.2 phi(u, v) - 0.7 u - 0.2: v(u) is curved through phi alone, and so is what phi is taken of."""
    return V + 0.2 * OPERATIONS[name] - 0.7 * U - 0.2


def expand(name, u):
    f = equation(name)
    return fl.implicit_taylor(f, U, V, [u], solve_implicit(f, U, V, [u], [0.2]), ORDER)


def operations(function):
    return {function.instruction_id(k) for k in range(function.n_instructions())}


def test_every_elementary_operation_is_among_them():
    """An operation added to the engine without a case here is found out."""
    used = set().union(*(operations(ca.Function("f", [X], [equation(name)])) for name in OPERATIONS))
    assert (set(unary) | set(binary)) - used <= {ca.OP_ASSIGN}  # CasADi writes no plain copies into SX functions


@pytest.mark.parametrize("name", OPERATIONS)
def test_moving_form_is_the_map_of_its_point(name):
    """The same polynomial, at the point where it was made and at another: a coefficient gone stale shows from order 3 on."""
    c, there = expand(name, HERE), expand(name, THERE)
    for known in (c, there):
        for du in (0.1, -0.3, 1.0):
            assert_allclose(c.moving(known.u0, known.v0, du).full()[:, 0], known([du]), rtol=1e-11)


def test_two_coordinates_and_a_coupled_solution():
    """Mixed derivatives: two equations whose functions have both unknowns in their arguments."""
    u, v = ca.SX.sym("u", 2), ca.SX.sym("v", 2)
    f = ca.vertcat(
        v[0] + 0.3 * ca.sin(v[0] * v[1] + v[0] ** 2) - u[0],
        v[1] + 0.2 * ca.exp(v[0] ** 2 - u[1] * v[1]) - u[1],
    )
    guess = solve_implicit(f, u, v, [0.4, 0.5], [0.3, 0.3])
    there = solve_implicit(f, u, v, [0.45, 0.44], [0.3, 0.3])
    c, other_map = (
        fl.implicit_taylor(f, u, v, *point, ORDER) for point in (([0.4, 0.5], guess), ([0.45, 0.44], there))
    )
    du = np.array([0.5, -0.7])
    assert_allclose(c.moving(c.u0, c.v0, du).full()[:, 0], c(du), rtol=1e-11)
    assert_allclose(c.moving(other_map.u0, other_map.v0, du).full()[:, 0], other_map(du), rtol=1e-11)
    errors = [np.linalg.norm(c.moving(c.u0, c.v0, h * du).full()[:, 0] - c.refined(h * du)) for h in (0.05, 0.1)]
    assert abs(np.log2(errors[1] / errors[0]) - (ORDER + 1)) < 0.3
