"""Taylor maps of closed loops against CasADi's repeated implicit differentiation and closed forms."""

from itertools import combinations_with_replacement, product

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin as fl
from flexlin.mechanics import Closure, five_bar

LEFT, RIGHT, BASE = (0.3, 0.5), (0.35, 0.45), 0.25
POSE = [2.2, -1.7, 0.9, 1.4, 0.1, 0.5]


def rssr():
    """Crank about z; coupler by azimuth s0 + s1 and elevation -s2 turned by s0 + s1; rocker about x through (0.2, 0.3, 0.1)."""
    s = ca.SX.sym("s", 4)
    a = s[0] + s[1]
    crank = 0.15 * ca.vertcat(ca.cos(s[0]), ca.sin(s[0]), 0)
    coupler = 0.4 * ca.vertcat(ca.cos(a) * ca.cos(s[2]), ca.sin(a) * ca.cos(s[2]), -ca.sin(s[2]))
    rocker = ca.vertcat(0.2, 0.3 - 0.3 * ca.cos(s[3]), 0.1 - 0.3 * ca.sin(s[3]))
    return Closure(crank + coupler - rocker, s)


LOOPS = {
    "5-bar inverse": (five_bar(BASE, LEFT, RIGHT), POSE, (4, 5)),
    "5-bar forward": (five_bar(BASE, LEFT, RIGHT), POSE, (0, 2)),
    "5-bar mixed": (five_bar(BASE, LEFT, RIGHT), POSE, (0, 5)),
    "RSSR": (rssr(), [0.7, 0.6, -0.3, 2.8], (0,)),
}


INVERSE = LOOPS["5-bar inverse"][0].equations((4, 5))
U, V = ca.SX.sym("u"), ca.SX.sym("v")


def expand(name, order):
    closure, guess, independent = LOOPS[name]
    return closure.taylor(closure.close(guess, independent), independent, order)


def solved(f, u0, v0, order=4):
    """The map of one unknown V of one number U."""
    return fl.implicit_taylor(f, U, V, [u0], [v0], order)


@pytest.fixture(scope="module")
def inverse():
    return expand("5-bar inverse", 5)


def implicit_derivatives(f, u, v, u0, v0, order):
    """D_(i_1) ... D_(i_k) v with D_i = d/du_i + C_1 e_i . d/dv, each by CasADi's directional derivative of the one before.

    Mixed derivatives commute, so only those with i_1 <= ... <= i_k are made and the others are copies.
    """
    first = -ca.solve(ca.jacobian(f, v), ca.jacobian(f, u))
    n = u.numel()
    flow = [ca.vertcat(ca.DM.eye(n)[:, i], first[:, i]) for i in range(n)]
    found = {(i,): first[:, i] for i in range(n)}
    for k in range(1, order):
        for last in combinations_with_replacement(range(n), k):
            for i in range(last[-1], n):
                found[*last, i] = ca.jtimes(found[last], ca.vertcat(u, v), flow[i])
    values = dict(zip(found, ca.Function("D", [u, v], list(found.values())).call([u0, v0]), strict=True))
    return [
        np.column_stack([values[tuple(sorted(index))].full()[:, 0] for index in product(range(n), repeat=k)])
        for k in range(1, order + 1)
    ]


@pytest.mark.parametrize("name", LOOPS)
def test_engine_against_repeated_implicit_differentiation(name):
    closure, _, independent = LOOPS[name]
    c, (f, u, v) = expand(name, 6), closure.equations(independent)
    for k, judge in enumerate(implicit_derivatives(f, u, v, c.u0, c.v0, 6), start=1):
        assert_allclose(c.jacobian(k), judge, rtol=0, atol=1e-12 * np.abs(judge).max())


def reach_circle_distances(point, d):
    """All t, complex too, at which point + t d leaves the reach of an arm, or meets its hinge's isotropic lines."""
    roots = []
    for origin, (a, b) in (((0, 0), LEFT), ((BASE, 0), RIGHT)):
        p = point - origin
        for reach in (a + b, abs(a - b), 0.0):
            roots += list(np.roots([1.0, 2 * p @ d, p @ p - reach**2]))
    return sorted(roots, key=abs)


def arm_angles(point, elbow):
    """Inverse kinematics of both arms in closed form."""
    angles = []
    for origin, (a, b), sign in zip(((0, 0), (BASE, 0)), (LEFT, RIGHT), elbow, strict=True):
        p = point - origin
        bend = sign * np.arccos((p @ p - a**2 - b**2) / (2 * a * b))
        angles += [np.arctan2(p[1], p[0]) - np.arctan2(b * np.sin(bend), a + b * np.cos(bend)), bend]
    return np.array(angles)


@pytest.mark.slow
def test_radius_against_reach_circles():
    kinds = {"real singularity": 0, "complex pair": 0, "not found": 0}
    points = np.array([(0.1, 0.5), (0.3, 0.45), (-0.15, 0.4), (0.05, 0.3)])
    for point, elbow in zip(points, [(1, 1), (-1, 1), (1, -1), (-1, -1)], strict=True):
        c = fl.implicit_taylor(*INVERSE, point, arm_angles(point, elbow), 2)
        for angle in np.linspace(0.1, 2 * np.pi, 4)[:-1]:
            d = np.array([np.cos(angle), np.sin(angle)])
            exact, radius = reach_circle_distances(point, d)[0], c.radius(2.5 * d)
            kinds[radius.kind] += 1
            if radius.kind != "not found":
                assert abs(radius - abs(exact)) < 1e-6
                assert (radius.kind == "real singularity") == (abs(exact.imag) < 1e-9)
            assert abs(exact.imag) > 0 or radius.kind == "real singularity"
    assert kinds["real singularity"] >= 4
    assert kinds["complex pair"] >= 2
    assert kinds["not found"] <= 1


def test_radius_names_the_singular_configuration(inverse):
    radius = inverse.radius([0, 1])
    assert radius.location.real > 0
    assert "ahead" in radius.status
    assert abs(np.sin(radius.v[1])) < 1e-9 or abs(np.sin(radius.v[3])) < 1e-9  # an arm is stretched or folded


def test_a_fold_on_either_side_of_a_stationary_point_is_found():
    """At the circle's top v' = 0, so no approximant of w''/w' shows the folds at u = 1 and -1."""
    radius = solved(U**2 + V**2 - 1, 0.0, 1.0, 6).radius([1.0])
    assert (float(radius), radius.kind) == (pytest.approx(1.0, abs=1e-9), "real singularity")


def test_a_straight_solution_has_no_radius_and_is_linear_everywhere():
    line = solved(V - 3 * U, 0.2, 0.6)
    radius = line.radius([1.0])
    assert radius.kind == "not found"
    assert np.isnan(radius)
    assert radius.estimate == line.linear_range(1e-3, [1.0]) == np.inf
    cubic = solved(V - 3 * U - 8 * U**3, 0.0, 0.0)
    assert cubic.linear_range(1e-3, [1.0]) == pytest.approx(0.05, rel=1e-12)


def test_pole_is_not_called_a_fold():
    radius = solved(V * (1 - U) - 1, 0.0, 1.0).radius([1.0])
    assert radius.kind == "not found"
    assert radius.estimate == pytest.approx(1, rel=0.06)  # read with the growth law of a fold
    assert "error" in radius.status


@pytest.mark.slow
def test_error_is_within_20_percent_inside_half_the_radius(inverse):
    maps = [expand("5-bar inverse", order) for order in (1, 2, 5, 8)]
    for angle in 2 * np.pi / 7 * np.arange(7):
        d = np.array([np.cos(angle), np.sin(angle)])
        du = np.linspace(0.1, 0.5, 9)[:, None] * inverse.radius(d) * d
        for c in maps:
            true = np.linalg.norm(c(du) - c.refined(du), axis=1)
            assert_allclose(c.error(du), true, rtol=0.2, atol=1e-14)
        assert inverse.error(du[3]) == pytest.approx(inverse.error(du)[3], rel=1e-12)


@pytest.mark.parametrize("angle", np.linspace(0.2, 6, 5))
def test_linear_range(inverse, angle):
    d, tol = np.array([np.cos(angle), np.sin(angle)]), 1e-3
    reach = inverse.linear_range(tol, 3 * d)
    C2 = inverse.jacobian(2)
    assert reach == pytest.approx(np.sqrt(2 * tol / np.linalg.norm(C2 @ np.kron(d, d))), rel=1e-12)
    linear = inverse.v0 + inverse.jacobian(1) @ (reach * d)
    assert np.linalg.norm(inverse.refined(reach * d) - linear) == pytest.approx(tol, rel=0.06)


def test_matrix_symbols_of_mx_kind():
    u, v = ca.MX.sym("u", 2), ca.MX.sym("v", 2)
    f = ca.vertcat(v[0] + ca.sin(v[1]) - u[0], v[1] * ca.exp(v[0]) - u[1])
    c = fl.implicit_taylor(f, u, v, [0.0, 0.0], [0.0, 0.0], 6)
    du = np.array([0.02, -0.03])
    assert_allclose(c(du), c.refined(du), atol=1e-9)


def test_few_digits_are_refined(inverse):
    rounded = fl.implicit_taylor(*INVERSE, inverse.u0, np.round(inverse.v0, 4), 5)
    assert_allclose(rounded.v0, inverse.v0, atol=1e-14)


def test_singular_point_is_named():
    f, u, v = five_bar(1.6, LEFT, LEFT).equations((4, 5))
    with pytest.raises(fl.errors.SingularClosure, match="closest singular configuration: u = ") as caught:
        fl.implicit_taylor(f, u, v, [0.8, 0.0], [0, 0, np.pi, 0], 3)
    assert "can move along" in str(caught.value)


def test_open_loop_is_refused():
    closure, guess, _ = LOOPS["5-bar inverse"]
    with pytest.raises(fl.errors.ArgumentError, match="independent"):
        closure.taylor(guess, (4,), 2)
    f, u, v = INVERSE
    for equations, words in ((f, "does not solve"), (f[:3], "equations")):
        with pytest.raises(fl.errors.ArgumentError, match=words):
            fl.implicit_taylor(equations, u, v, [0.1, 0.5], [1.0, 1.0, 1.0, 1.0], 3)


def test_refinement_outside_the_reach_says_so(inverse):
    with pytest.raises(fl.errors.ToleranceNotReached, match="radius"):
        inverse.refined([2.0, 0.0])
    assert inverse.error([2.0, 0.0]) > 0.1


def test_implicit_series_in_many_variables():
    """v(u) put into f leaves no part of any degree; 6 variables at order 8 are beyond listed products."""
    u, v = ca.SX.sym("u", 6), ca.SX.sym("v")
    total = ca.sum1(u) + u[0] * u[5]
    c = fl.implicit_taylor(ca.exp(v) - 1 - total, u, v, np.zeros(6), [0.0], 8).polynomial
    judge = fl.taylor(ca.log(1 + total), u, np.zeros(6), 8).polynomial
    assert_allclose(c.coefficients, judge.coefficients, rtol=1e-11, atol=1e-11)


@pytest.mark.peers
def test_inverse_kinematics_against_daceypy():
    """Every coefficient by truncated polynomials of an independent program in C++, where Newton's method gains one order a step."""
    DA, order = pytest.importorskip("daceypy").DA, 7
    DA.init(order, 2)
    c, (f, u, v) = expand("5-bar inverse", order), INVERSE
    W = np.linalg.inv(ca.Function("V", [u, v], [ca.jacobian(f, v)])(c.u0, c.v0).full())
    x, q = [c.u0[0] + DA(1), c.u0[1] + DA(2)], [DA(1) * 0 + angle for angle in c.v0]
    for _ in range(order):
        gap = []
        for origin, (a, b), (first, bend) in ((0.0, LEFT, q[:2]), (BASE, RIGHT, q[2:])):
            both = first + bend
            gap.append(x[0] - origin - a * first.cos() - b * both.cos())
            gap.append(x[1] - a * first.sin() - b * both.sin())
        q = [q[i] - sum(float(W[i, j]) * gap[j] for j in range(4)) for i in range(4)]
    found, degrees = c.polynomial.coefficients, c.polynomial.indices.degrees
    powers = c.polynomial.indices.powers.tolist()
    judge = np.array([[angle.getCoefficient(alpha) for angle in q] for alpha in powers])
    for k in range(order + 1):
        assert_allclose(found[degrees == k], judge[degrees == k], atol=1e-12 * np.abs(judge[degrees == k]).max())
