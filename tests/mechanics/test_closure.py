"""The differentiation-free recursion against repeated implicit differentiation of closure equations written by hand in CasADi."""

import tracemalloc

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

from flexlin.errors import ArgumentError, SingularClosure, TooLarge
from flexlin.kronecker import derivative
from flexlin.mechanics import five_bar, four_bar, rssr


def planar_tip(base, lengths, angles):
    total, x = 0, ca.SX(base)
    for length, angle in zip(lengths, angles, strict=True):
        total += angle
        x = x + length * ca.vertcat(ca.cos(total), ca.sin(total))
    return x


def five_bar_equations(s):
    left = planar_tip([0, 0], (0.3, 0.5), (s[0], s[1]))
    right = planar_tip([0.25, 0], (0.35, 0.45), (s[2], s[3]))
    return ca.vertcat(s[4:] - left, s[4:] - right)


def four_bar_equations(s):
    return planar_tip([0, 0], (0.2, 0.5), (s[0], s[1])) - planar_tip([0.4, 0], (0.35,), (s[2],))


def rssr_equations(s):
    """Crank about z; coupler by azimuth s0 + s1 and elevation -s2 turned by s0 + s1; rocker about x through (0.2, 0.3, 0.1)."""
    a = s[0] + s[1]
    crank = 0.15 * ca.vertcat(ca.cos(s[0]), ca.sin(s[0]), 0)
    coupler = 0.4 * ca.vertcat(ca.cos(a) * ca.cos(s[2]), ca.sin(a) * ca.cos(s[2]), -ca.sin(s[2]))
    rocker = ca.vertcat(0.2, 0.3 - 0.3 * ca.cos(s[3]), 0.1 - 0.3 * ca.sin(s[3]))
    return crank + coupler - rocker


LOOPS = {
    "5-bar inverse": (
        five_bar(0.25, (0.3, 0.5), (0.35, 0.45)),
        five_bar_equations,
        [2.2, -1.7, 0.9, 1.4, 0.1, 0.5],
        (4, 5),
    ),
    "5-bar forward": (
        five_bar(0.25, (0.3, 0.5), (0.35, 0.45)),
        five_bar_equations,
        [2.2, -1.7, 0.9, 1.4, 0.1, 0.5],
        (0, 2),
    ),
    "5-bar mixed": (
        five_bar(0.25, (0.3, 0.5), (0.35, 0.45)),
        five_bar_equations,
        [2.2, -1.7, 0.9, 1.4, 0.1, 0.5],
        (0, 5),
    ),
    "4-bar": (four_bar(0.4, 0.2, 0.5, 0.35), four_bar_equations, [0.9, -0.8, 1.3], (0,)),
    "4-bar from its rocker": (four_bar(0.4, 0.2, 0.5, 0.35), four_bar_equations, [0.9, -0.8, 1.3], (2,)),
    "RSSR": (rssr(0.15, 0.4, 0.3, (0.2, 0.3, 0.1), (1, 0, 0)), rssr_equations, [0.7, 0.6, -0.3, 2.8], (0,)),
}


@pytest.fixture(params=LOOPS)
def loop(request):
    closure, equations, guess, u = LOOPS[request.param]
    return closure, equations, closure.close(guess, u), u


def implicit_derivatives(equations, s0, u, order):
    """C_1 = -V^-1 U, C_(k+1) = D_u C_k + D_v C_k (E (x) C_1), each symbolic."""
    n = len(s0)
    s = ca.SX.sym("s", n)
    f = equations(s)
    J = ca.jacobian(f, s)
    v = [i for i in range(n) if i not in u]
    C = [-ca.solve(J[:, v], J[:, list(u)])]
    for _ in range(1, order):
        D = derivative(C[-1], s)
        columns = [D[:, j * n : (j + 1) * n] for j in range(C[-1].shape[1])]
        C.append(ca.horzcat(*[c[:, list(u)] + c[:, v] @ C[0] for c in columns]))
    return [Ck.full() for Ck in ca.Function("C", [s], C).call([s0])]


def test_closed_configuration_satisfies_the_equations_by_hand(loop):
    _, equations, s0, _ = loop
    s = ca.SX.sym("s", len(s0))
    assert np.abs(ca.Function("f", [s], [equations(s)])(s0).full()).max() < 1e-14


def test_expression_equals_the_equations_by_hand(loop):
    closure, equations, s0, _ = loop
    s = ca.SX.sym("s", len(s0))
    away = s0 + 0.3 * np.cos(np.arange(len(s0)))
    ours, judge = ca.Function("f", [s], [closure.expression(s), equations(s)]).call([away])
    assert_allclose(ours.full(), judge.full(), atol=1e-14)


@pytest.mark.slow
def test_recursion_against_implicit_differentiation(loop):
    closure, equations, s0, u = loop
    order = 6 if len(u) == 1 else 4
    judges = implicit_derivatives(equations, s0, u, order)
    for ours, judge in zip(closure.jacobians(s0, u, order), judges, strict=True):
        assert_allclose(ours, judge, rtol=0, atol=1e-12 * np.abs(judge).max())


@pytest.mark.parametrize("name", ["5-bar forward", "4-bar", "4-bar from its rocker", "RSSR"])
def test_partitions_exercise_the_second_term(name):
    """D_s U must not vanish somewhere, or the sign error of Eq (21) would hide."""
    closure, _, guess, u = LOOPS[name]
    m, n = closure.linear.shape
    second = closure.derivative(closure.close(guess, u), 2).reshape(m, n, n)
    assert np.abs(second[:, list(u)]).max() > 0.05


def test_singular_and_open_loops_are_named():
    closure = LOOPS["5-bar inverse"][0]
    with pytest.raises(ArgumentError, match="open"):
        closure.jacobians(LOOPS["5-bar inverse"][2], (4, 5), 2)
    stretched = five_bar(1.6, (0.3, 0.5), (0.3, 0.5))
    with pytest.raises(SingularClosure, match="singular"):
        stretched.jacobians([0, 0, np.pi, 0, 0.8, 0], (4, 5), 2)
    with pytest.raises(ArgumentError, match="independent"):
        closure.jacobians(closure.close(LOOPS["5-bar inverse"][2], (4, 5)), (4,), 2)


def test_unreasonable_orders_are_refused_with_their_size():
    closure, guess, u = (LOOPS["5-bar forward"][i] for i in (0, 2, 3))
    s0 = closure.close(guess, u)
    tracemalloc.start()
    with pytest.raises(TooLarge, match=r"[\d,]+ bytes"):
        closure.jacobians(s0, u, 9)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6
