"""Screws against the matrix exponential, partials against automatic differentiation, closure equations against those by hand."""

from itertools import product
from math import comb

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

import flexlin as fl
from flexlin.errors import ArgumentError, SingularClosure, TooLarge
from flexlin.kronecker import derivative
from flexlin.mechanics import five_bar
from flexlin.mechanics.screws import Ad, ad, exponential, hat, helical, prismatic, revolute, skew
from tests.memory import at_most
from tests.series.test_implicit import LOOPS

HINGES = revolute([0, 0, 1], [0.1, 0.2, 0]), revolute([0.3, 1, -0.2], [0.5, 0.1, -0.3])
SCREWS = np.array([HINGES[0], helical([1, 0.3, 0], [0, 0.4, 0.5], 0.07), prismatic([0.2, -1, 0.4]), HINGES[1]])
HOME = expm(hat(np.array([0.3, -0.2, 0.5, 0.4, 0.1, -0.6])))
CHAIN = fl.screws.OpenChain(SCREWS, HOME)
Q = np.array([0.4, -0.9, 0.3, 1.3])


@pytest.mark.parametrize("screw", [*SCREWS, 2.3 * SCREWS[1]])
@pytest.mark.parametrize("q", [0.0, 1e-9, 0.7, -4.0])
def test_exponential_is_the_matrix_exponential(screw, q):
    assert_allclose(exponential(screw, q), expm(hat(screw) * q), atol=1e-13)
    assert_allclose(Ad(exponential(screw, q)), expm(ad(screw) * q), atol=1e-12)


def test_helical_joint_advances_by_its_pitch():
    moved = exponential(helical([0, 0, 2.0], [1, 0, 0], 0.25), np.pi) @ np.array([0, 0, 0, 1.0])
    assert_allclose(moved, [2, 0, 0.25 * np.pi, 1], atol=1e-14)


def test_adjoint_identities():
    t, s = np.random.default_rng(1).normal(size=(2, 6))
    assert_allclose(hat(Ad(HOME) @ t), HOME @ hat(t) @ np.linalg.inv(HOME), atol=1e-13)
    assert_allclose(ad(Ad(HOME) @ t), Ad(HOME) @ ad(t) @ np.linalg.inv(Ad(HOME)), atol=1e-12)  # (4), corrected
    assert_allclose(hat(ad(t) @ s), hat(t) @ hat(s) - hat(s) @ hat(t), atol=1e-13)


def symbolic_exponential(t, q):
    """A series-free symbolic exponential: the closed form from the minimal polynomial, written anew."""
    X, w = ca.DM(hat(t)), float(np.linalg.norm(t[:3]))
    if w == 0:
        return ca.SX.eye(4) + q * X
    X2 = X @ X
    return ca.SX.eye(4) + q * X + (1 - ca.cos(w * q)) / w**2 * X2 + (w * q - ca.sin(w * q)) / w**3 * (X2 @ X)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_all_partials_by_13_against_automatic_differentiation(order):
    q, H = ca.SX.sym("q", 4), ca.SX(ca.DM(HOME))
    for i in reversed(range(4)):
        H = symbolic_exponential(SCREWS[i], q[i]) @ H
    dense = ca.Function("D", [q], [derivative(H, q, order)])(Q).full().reshape(4, 4, *[4] * order)
    for index in product(range(4), repeat=order):
        alpha = np.bincount(np.array(index, int), minlength=4)
        assert_allclose(CHAIN.partial(Q, alpha), dense[(..., *index)], atol=1e-12)
    assert_allclose(CHAIN.adjoint(Q), Ad(CHAIN.pose(Q)), atol=0)
    assert_allclose(CHAIN.partial(Q, [0, 0, 0, 0]), CHAIN.pose(Q), atol=0)


@pytest.mark.parametrize("alpha", [(1, 0, 0, 0), (0, 2, 0, 1), (1, 1, 1, 2)])
def test_adjoint_partials_13(alpha):
    """D Ad by its own formula against Leibniz' rule on [o x] R, whose derivatives come from the pose formula."""
    D, A = CHAIN.partial(Q, alpha), CHAIN.adjoint_partial(Q, alpha)
    assert_allclose(A[:3, :3], D[:3, :3], atol=1e-12)
    assert_allclose(A[3:, 3:], D[:3, :3], atol=1e-12)
    lower = np.zeros((3, 3))
    for beta in product(*[range(a + 1) for a in alpha]):
        times = np.prod([comb(a, b) for a, b in zip(alpha, beta, strict=True)])
        o = CHAIN.partial(Q, beta)[:3, 3]
        lower += times * skew(o) @ CHAIN.partial(Q, np.subtract(alpha, beta))[:3, :3]
    assert_allclose(A[3:, :3], lower, atol=1e-12)


WRONG = {
    "screws": lambda: fl.screws.OpenChain(np.ones((2, 5)), HOME),
    "rigid": lambda: fl.screws.OpenChain(SCREWS, 2 * np.eye(4)),
    "direction": lambda: prismatic([0, 0, 0]),
    "multi-index": lambda: CHAIN.partial(Q, [1, 0, 0]),
    "multi-index.*-1": lambda: CHAIN.partial(Q, [1, 0, 0, -1]),
    r"multi-index.*0\.5": lambda: CHAIN.partial(Q, [0.5, 0, 0, 0]),
}


@pytest.mark.parametrize("words", WRONG)
def test_what_is_no_screw_or_multi_index_is_refused(words):
    with pytest.raises(fl.errors.ArgumentError, match=words):
        WRONG[words]()


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
