"""Straight-line code of implicit maps where every elementary function has a nonlinear argument: at its own point, at others, as C.

The judge shares nothing with the series: roots of f(u, v) = 0 in 40 digits by mpmath, or the closed map's own Newton refinement.
"""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin as fl
from flexlin.series import solve_implicit
from flexlin.series.jets import binary, unary
from tests.thinned import thin

ORDER = 6
STRENGTH = 0.2


def argument(u, v):
    """A curved argument between 0.4 and 0.8 at the points of these tests."""
    return 0.35 + 0.3 * u * v + 0.5 * v * v - 0.2 * u * u


def other(u, v):
    """A second curved argument, for operations of two."""
    return 0.6 + 0.4 * v * v - 0.3 * u * v * v


def both(name):
    """The same function of CasADi and of mpmath."""
    return getattr(ca, name), getattr(mp, name)


FUNCTIONS = {
    "exp": both("exp"),
    "log": both("log"),
    "sqrt": both("sqrt"),
    "sin": both("sin"),
    "cos": both("cos"),
    "tan": both("tan"),
    "sinh": both("sinh"),
    "cosh": both("cosh"),
    "tanh": both("tanh"),
    "asin": both("asin"),
    "acos": both("acos"),
    "atan": both("atan"),
    "asinh": both("asinh"),
    "atanh": both("atanh"),
    "acosh": (lambda a: ca.acosh(1 + a), lambda a: mp.acosh(1 + a)),
    "erf": both("erf"),
    "log1p": (ca.log1p, lambda a: mp.log(1 + a)),
    "expm1": both("expm1"),
    "square": (lambda a: a * a, lambda a: a * a),
    "inverse": (lambda a: ca.sin(1 / a), lambda a: mp.sin(1 / a)),
    "twice": (lambda a: ca.sin(a + a), lambda a: mp.sin(2 * a)),
    "negative": (lambda a: -a, lambda a: -a),
    "fifth power": (lambda a: a**5, lambda a: a**5),
    "broken power": (lambda a: a**2.7, lambda a: a ** mp.mpf(2.7)),
    "negative power": (lambda a: a**-3, lambda a: a**-3),
    "switch off": (lambda a: ca.if_else(ca.logic_not(a < 0.1), ca.exp(a), -a), mp.exp),
}
PAIRS = {
    "sum": (lambda a, b: a + b,) * 2,
    "difference": (lambda a, b: a - b,) * 2,
    "product": (lambda a, b: a * b,) * 2,
    "quotient": (lambda a, b: a / b,) * 2,
    "atan2": both("atan2"),
    "atan2 behind": (lambda a, b: ca.atan2(a, b - 3), lambda a, b: mp.atan2(a, b - 3)),
    "hypot": both("hypot"),
    "varying power": (ca.power, lambda a, b: a**b),
    "choice and": (lambda a, b: ca.if_else(ca.logic_and(a < 5, b <= 5), ca.sin(a), b), lambda a, b: mp.sin(a)),
    "choice or": (lambda a, b: ca.if_else(ca.logic_or(a < -5, b <= 5), ca.exp(b), a), lambda a, b: mp.exp(b)),
}


def of_arguments(place):
    """Every function of (u, v) through its curved arguments: place 0 for CasADi, 1 for mpmath."""

    def one(f):
        return lambda u, v: f(argument(u, v))

    def two(f):
        return lambda u, v: f(argument(u, v), other(u, v))

    return {name: one(f[place]) for name, f in FUNCTIONS.items()} | {name: two(f[place]) for name, f in PAIRS.items()}


EVERY, JUDGES = of_arguments(0), of_arguments(1)
HERE, THERE = 0.3, 0.38
"""Where a map is made, and where its moving form is asked."""


def equation(function, u, v):
    """v + 0.2 phi(u, v) - 0.7 u - 0.2: v(u) is curved through phi's argument alone."""
    return v + STRENGTH * function(u, v) - 0.7 * u - 0.2


def exact(name, u):
    """v(u) in 40 digits."""
    with mp.workdps(40):
        point = mp.mpf(u)
        return mp.findroot(lambda v: equation(JUDGES[name], point, v), mp.mpf(0.3))


def expand(name, order=ORDER):
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    return fl.implicit_taylor(equation(EVERY[name], u, v), u, v, [HERE], [float(exact(name, HERE))], order)


def operations(function):
    return {function.instruction_id(k) for k in range(function.n_instructions())}


def test_every_elementary_operation_is_among_them():
    """An operation added to the engine without a case here is found out."""
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    used = set()
    for function in EVERY.values():
        used |= operations(ca.Function("f", [u, v], [equation(function, u, v)]))
    assert (set(unary) | set(binary)) - used <= {ca.OP_ASSIGN}  # CasADi writes no plain copies into SX functions


@pytest.mark.parametrize("name", EVERY)
def test_moving_form_is_the_map_of_its_point(name):
    """The same polynomial, at the point where it was made and at another: a coefficient gone stale shows from order 3 on."""
    c = expand(name)
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    there = fl.implicit_taylor(equation(EVERY[name], u, v), u, v, [THERE], [float(exact(name, THERE))], ORDER)
    for known in (c, there):
        for du in (0.1, -0.3, 1.0):
            assert_allclose(c.moving(known.u0, known.v0, du).full()[:, 0], known([du]), rtol=1e-11)


@pytest.mark.parametrize("name", thin(EVERY, 12))
def test_error_of_the_moving_form_falls_with_its_order(name):
    """|moving - v| against the true v in 40 digits: a slope of order + 1, so every coefficient up to the order is right."""
    order = 4
    moving, v0 = expand(name, order).moving, float(exact(name, THERE))
    steps = np.array([0.025, 0.05, 0.1])
    errors = [
        float(max(abs(mp.mpf(float(moving([THERE], [v0], s * h))) - exact(name, THERE + s * h)) for s in (1, -1)))
        for h in steps
    ]
    if errors[0] > 1e-12:  # else the polynomial is v itself, or as good as rounding
        assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > order + 0.7


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
