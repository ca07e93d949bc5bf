"""Taylor maps of expressions: every elementary operation against CasADi's repeated differentiation, slopes, sizes, refusals; and maps as
straight-line code, at the point they were made for and at others, and as C.
"""

import ctypes
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin as fl
from flexlin.mechanics import five_bar
from flexlin.series import c_code, solve_implicit
from flexlin.series.jets import binary, unary
from tests.memory import at_most

X = ca.SX.sym("x", 2)
A, B = 0.6 * X[0] - 0.3 * X[1] + 0.4, 0.5 * X[0] * X[1] + 0.2 * X[1] + 0.3
OPERATIONS = {
    **{name: getattr(ca, name)(A) for name in ("exp", "sin", "cos", "tan", "asin", "acos", "atan", "sqrt", "log")},
    **{name: getattr(ca, name)(B) for name in ("sinh", "cosh", "tanh", "asinh", "atanh", "erf", "log1p", "expm1")},
    "acosh": ca.acosh(2 + A),
    "atan2": ca.atan2(A, B),
    "atan2 behind": ca.atan2(A, B - 3),
    "hypot": ca.hypot(A, B),
    "division": A / (B + 1),
    "inverse": ca.sin(1 / A),
    **{f"power {k}": A**k for k in (2, 3, -3, 2.7)},
    "fifth power": (A + B) ** 5,
    "varying power": ca.power(A, B),
    "constant base": ca.power(2.5, B),
    "twice": ca.sin(A + A),
    "negative": ca.exp(-B),
    "choice": ca.if_else(ca.logic_and(A > 0, B <= 3), ca.sin(A), np.nan),
    "other choice": ca.if_else(ca.logic_or(A < 0, ca.logic_not(B > 0)), ca.sqrt(A - 7), ca.exp(B)),
    "mixed": ca.sin(ca.exp(A) * ca.cos(B)) / (1 + B**2) - ca.sqrt(1 + A * B),
}
POINT = np.array([0.13, -0.21])


def assert_derivatives(P, expression):
    """All derivatives of a map of X at POINT are those of repeated differentiation."""
    derivatives = [fl.kronecker.derivative(expression, X, k) for k in range(P.order + 1)]
    for k, judge in enumerate(ca.Function("D", [X], derivatives).call([POINT])):
        assert_allclose(P.derivative(k), judge.full(), rtol=1e-11, atol=1e-11 * np.abs(judge.full()).max())


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_against_repeated_differentiation(name):
    assert_derivatives(fl.taylor(OPERATIONS[name], X, POINT, 4), OPERATIONS[name])


def test_layout_of_a_matrix():
    matrix = ca.blockcat([[ca.sin(X[0] * X[1]), X[0] ** 2, 3], [X[1], ca.exp(X[0]), ca.cos(X[1])]])
    P = fl.taylor(matrix, X, POINT, 3)
    assert_derivatives(P, matrix)
    dx = np.array([[0.02, -0.03], [0.01, 0.05]])
    sums = [fl.kronecker.taylor_sum([P.derivative(k) for k in range(4)], d[:, None]) for d in dx]
    assert_allclose(P(dx), sums, atol=1e-14)
    assert_allclose(P(dx[0]), sums[0], atol=1e-14)
    assert_allclose(P.function()(dx[1]).full(), sums[1], atol=1e-14)


def test_matrix_symbols_of_mx_kind():
    x = ca.MX.sym("x", 2)
    P = fl.taylor(ca.sin(x) * x[0], x, POINT, 2)
    assert_allclose(P(np.zeros(2))[:, 0], np.sin(POINT) * POINT[0], atol=1e-16)


def test_geometric_series_and_whole_powers_at_zero():
    x = ca.SX.sym("x")
    assert_allclose(fl.taylor(1 / (1 - x), x, [0.0], 30).polynomial.coefficients[:, 0], np.ones(31), atol=0)
    powers = fl.taylor((x + x**2) ** 6, x, [0.0], 9).polynomial.coefficients
    assert_allclose(powers[6:, 0], [1, 6, 15, 20], atol=1e-13)


def test_unreasonable_sizes_are_refused_before_anything_is_allocated():
    x = ca.SX.sym("x", 12)
    P = fl.taylor(ca.sin(ca.sum1(x)), x, np.zeros(12), 3)
    with at_most(5e6):
        with pytest.raises(fl.errors.TooLarge, match=r"[\d,]+ bytes"):
            fl.taylor(ca.sin(ca.sum1(x)), x, np.zeros(12), 14)
        big = fl.taylor(ca.sin(X[0]), X, POINT, 28)
        with pytest.raises(fl.errors.TooLarge, match=f"{8 * 2**28 * 3:,} bytes"):
            big.derivative(28)
    assert P.derivative(3).shape == (1, 12**3)


REFUSED = {
    "fabs": lambda: fl.taylor(ca.fabs(A), X, POINT, 2),
    "free": lambda: fl.taylor(A * ca.SX.sym("z"), X, POINT, 2),
    "no power series": lambda: fl.taylor(ca.sqrt(X[0]), X, np.zeros(2), 2),
    "no power.* series": lambda: fl.taylor(ca.log(X[0]), X, np.array([-1.0, 0]), 2),
    "x0": lambda: fl.taylor(A, X, np.zeros(3), 2),
    "column of symbols": lambda: fl.taylor(A, X + 1, POINT, 2),
    "order": lambda: fl.taylor(A, X, POINT, -1),
    "derivative": lambda: fl.taylor(A, X, POINT, 2).derivative(3),
    "dx": lambda: fl.taylor(A, X, POINT, 2)(np.zeros(3)),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_has_no_series_or_does_not_fit_is_refused(words):
    with pytest.raises(fl.errors.ArgumentError, match=words):
        REFUSED[words]()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "order", "supports"),
    [
        (5, 9, (range(5), (0, 4), (3,))),
        (6, 8, ((1, 2), range(6), (5,))),
        (9, 6, (range(9), range(4, 9), (0, 8))),
        (12, 5, (range(7), range(7, 12), (11,))),
    ],
)
def test_many_variables_against_series_in_directions(n, order, supports):
    """Along random lines the map in n variables is a series in one variable, where products are listed one by one."""
    x, t, rng = ca.SX.sym("x", n), ca.SX.sym("t"), np.random.default_rng(n)
    forms = [sum((0.3 + 0.1 * i) * x[i] for i in support) for support in supports]
    f = ca.exp(forms[0]) * ca.sin(forms[1]) + (x[0] * x[n - 1] + x[1]) ** 3 / (2 + forms[2])
    point = 0.3 * rng.normal(size=n)
    P = fl.taylor(f, x, point, order)
    c = P.polynomial
    second = ca.Function("D", [x], [fl.kronecker.derivative(f, x, 2)])(point).full()
    assert_allclose(P.derivative(2), second, atol=1e-13 * np.abs(second).max())
    assert_allclose(P.function()(point), P(point), rtol=1e-11)
    for direction in rng.normal(size=(8, n)):
        terms = c.indices.monomials(direction) * c.coefficients[:, 0]
        line, sizes = (np.add.reduceat(one, c.indices.start[:-1]) for one in (terms, np.abs(terms)))
        judge = fl.taylor(ca.substitute(f, x, ca.DM(point) + t * direction), t, [0.0], order).polynomial.coefficients
        assert np.all(np.abs(line - judge[:, 0]) < 1e-14 * sizes + 1e-13 * np.abs(judge[:, 0]))


def test_every_coefficient_in_twelve_variables():
    """exp(w x) has the coefficients w^alpha / alpha!, and sin(w x) the same with signs."""
    x, w = ca.SX.sym("x", 12), np.linspace(0.5, -0.4, 12)
    phase = ca.dot(ca.DM(w), x)
    P = fl.taylor(ca.vertcat(ca.exp(phase), ca.sin(phase)), x, np.zeros(12), 7).polynomial
    exact = np.prod(w**P.indices.powers, axis=1) / P.indices.factorials
    assert_allclose(P.coefficients[:, 0], exact, rtol=1e-13)
    sign = np.array([0.0, 1, 0, -1])[P.indices.degrees % 4]
    assert_allclose(P.coefficients[:, 1], sign * exact, rtol=1e-13, atol=0)


def test_many_variables_take_little_memory():
    x = ca.SX.sym("x", 12)
    with at_most(25e6):
        fl.taylor(ca.sin(ca.sum1(x)) * ca.exp(x[3] - x[7]), x, np.zeros(12), 7)


LOOP = five_bar(0.25, (0.3, 0.5), (0.35, 0.45))
S0 = LOOP.close([2.2, -1.7, 0.9, 1.4, 0.1, 0.5], (4, 5))


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_c_code(tmp_path):
    c, du = LOOP.taylor(S0, (4, 5), 3), np.array([0.03, -0.02])
    (tmp_path / "taylor.c").write_text(c_code(c.moving))
    subprocess.run(["gcc", "-O1", "-fPIC", "-shared", "taylor.c", "-o", "taylor.so", "-lm"], cwd=tmp_path, check=True)
    compiled = ca.external("taylor", str(tmp_path / "taylor.so"))
    assert_allclose(compiled(c.u0, c.v0, du).full()[:, 0], c(du), rtol=1e-12)
    assert ctypes.CDLL(str(tmp_path / "taylor.so")).taylor_n_in() == 3


def test_six_variables_at_order_5_stay_small():
    rng = np.random.default_rng(2)
    u, v = ca.SX.sym("u", 6), ca.SX.sym("v", 6)
    A, B, v0 = 0.3 * rng.normal(size=(6, 6)), rng.normal(size=(6, 6)), rng.normal(size=6)
    f = v + A @ (ca.sin(B @ v) * ca.cos(v)) - u
    u0 = v0 + A @ (np.sin(B @ v0) * np.cos(v0))
    with at_most(200e6):
        c = fl.implicit_taylor(f, u, v, u0, v0, 5)
    du = 0.01 * np.array([1, -1, 0.5, 0.3, -0.8, 0.4])
    missed = np.linalg.norm(c(du) - c.refined(du))
    assert missed < 1e-6
    assert c.error(du) == pytest.approx(missed, rel=0.2)
    assert_allclose(c.moving(c.u0, c.v0, du).full()[:, 0], c(du), rtol=1e-12)
    assert_allclose(c.function()(du).full()[:, 0], c(du), rtol=1e-13)
    assert c.moving.n_instructions() < 5000  # of one variable, at order 5: 3,600


ORDER = 6
U, V = X[0], X[1]
HERE, THERE = 0.3, 0.38
"""Where a map is made, and where its moving form is asked."""


def equation(name):
    """v + 0.2 phi(u, v) - 0.7 u - 0.2: v(u) is curved through phi alone, and so is what phi is taken of."""
    return V + 0.2 * OPERATIONS[name] - 0.7 * U - 0.2


def map_of(name, u):
    f = equation(name)
    return fl.implicit_taylor(f, U, V, [u], solve_implicit(f, U, V, [u], [0.2]), ORDER)


def test_every_elementary_operation_is_among_them():
    """An operation added to the engine without a case here is found out."""
    used = set()
    for name in OPERATIONS:
        function = ca.Function("f", [X], [equation(name)])
        used |= {function.instruction_id(k) for k in range(function.n_instructions())}
    assert (set(unary) | set(binary)) - used <= {ca.OP_ASSIGN}  # CasADi writes no plain copies into SX functions


@pytest.mark.parametrize("name", OPERATIONS)
def test_moving_form_is_the_map_of_its_point(name):
    """The same polynomial, at the point where it was made and at another: a coefficient gone stale shows from order 3 on."""
    c, there = map_of(name, HERE), map_of(name, THERE)
    for known in (c, there):
        for du in (0.1, -0.3, 1.0):
            assert_allclose(c.moving(known.u0, known.v0, du).full()[:, 0], known([du]), rtol=1e-11)
