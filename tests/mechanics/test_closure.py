"""Closure equations of screws against those written by hand in CasADi, and what is refused; their derivatives: tests/series."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

from flexlin.errors import ArgumentError, SingularClosure, TooLarge
from flexlin.mechanics import five_bar
from tests.memory import at_most
from tests.series.test_implicit import LOOPS


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


BY_HAND = {"5-bar": five_bar_equations, "4-bar": four_bar_equations, "RSSR": rssr_equations}


@pytest.mark.parametrize("name", LOOPS)
def test_expression_equals_the_equations_by_hand(name):
    """Away from the closed configuration, and zero there."""
    closure, guess, independent = LOOPS[name]
    s0 = closure.close(guess, independent)
    s = ca.SX.sym("s", len(s0))
    both = ca.Function("f", [s], [closure.expression(s), BY_HAND[name.split()[0]](s)])
    ours, judge = both.call([s0 + 0.3 * np.cos(np.arange(len(s0)))])
    assert_allclose(ours.full(), judge.full(), atol=1e-14)
    assert np.abs(both(s0)[1].full()).max() < 1e-14


def test_singular_and_open_loops_are_named():
    closure, guess, independent = LOOPS["5-bar inverse"]
    with pytest.raises(ArgumentError, match="open"):
        closure.jacobians(guess, independent, 2)
    with pytest.raises(SingularClosure, match="singular"):
        five_bar(1.6, (0.3, 0.5), (0.3, 0.5)).jacobians([0, 0, np.pi, 0, 0.8, 0], independent, 2)
    with pytest.raises(ArgumentError, match="independent"):
        closure.jacobians(closure.close(guess, independent), (4,), 2)


def test_unreasonable_orders_are_refused_with_their_size():
    closure, guess, u = LOOPS["5-bar forward"]
    s0 = closure.close(guess, u)
    with at_most(1e6), pytest.raises(TooLarge, match=r"[\d,]+ bytes"):
        closure.jacobians(s0, u, 9)
