"""Screws against the matrix exponential, partials against automatic differentiation."""

from itertools import product

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

import flexlin as fl
from flexlin.kronecker import derivative
from flexlin.mechanics.screws import Ad, ad, exponential, hat, helical, prismatic, revolute

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


def symbolic_exponential(t, q):
    """A series-free symbolic exponential: the closed form from the minimal polynomial, written anew."""
    X, w = ca.DM(hat(t)), float(np.linalg.norm(t[:3]))
    if w == 0:
        return ca.SX.eye(4) + q * X
    X2 = X @ X
    return ca.SX.eye(4) + q * X + (1 - ca.cos(w * q)) / w**2 * X2 + (w * q - ca.sin(w * q)) / w**3 * (X2 @ X)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_all_partials_by_13_against_automatic_differentiation(order):
    """Of the pose, and of its adjoint."""
    q, H = ca.SX.sym("q", 4), ca.SX(ca.DM(HOME))
    for i in reversed(range(4)):
        H = symbolic_exponential(SCREWS[i], q[i]) @ H
    R = H[:3, :3]
    adjoint = ca.blockcat([[R, ca.SX(3, 3)], [ca.skew(H[:3, 3]) @ R, R]])
    for size, made, partial in ((4, H, CHAIN.partial), (6, adjoint, CHAIN.adjoint_partial)):
        dense = ca.Function("D", [q], [derivative(made, q, order)])(Q).full().reshape(size, size, *[4] * order)
        for index in product(range(4), repeat=order):
            alpha = np.bincount(np.array(index, int), minlength=4)
            assert_allclose(partial(Q, alpha), dense[(..., *index)], atol=1e-11)
    assert_allclose(CHAIN.adjoint(Q), Ad(CHAIN.pose(Q)), atol=0)
    assert_allclose(CHAIN.partial(Q, [0, 0, 0, 0]), CHAIN.pose(Q), atol=0)


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
