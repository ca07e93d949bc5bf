"""Flexible chains against rigid segments with springs, converging with their length squared (fourth power if unclamped)."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import eigh

from tests.thinned import thin

from .scenes import arm_of
from .segments import Segments

ONE = {"length": 0.8, "mass_per_length": 0.4, "bending_stiffness": 2.0}
TWO = {"length": 0.5, "mass_per_length": 0.2, "bending_stiffness": 1.0}
COUNTS = (12, 24, 48)
LOADED = {"modes": 12, "mode_shapes": "clamped-loaded"}


def check(chain, approximations, order):
    """The segments converge with their order, and what they converge to (Richardson) is the chain's answer."""
    coarse, middle, fine = approximations
    np.testing.assert_allclose(np.log2((coarse - middle) / (middle - fine)), order, atol=0.25)
    np.testing.assert_allclose(chain, fine + (fine - middle) / (2**order - 1), rtol=1e-5)


def lowest(K, M, count):
    return np.sqrt(np.abs(eigh(K, M, eigvals_only=True)))[:count]


def test_frequencies_of_a_bent_elbow():
    """Two links at q2 = 0.7 with free joints: two zero frequencies, then the elastic ones of the coupled arm."""
    arm = arm_of({**ONE, **LOADED}, {**TWO, **LOADED}, effects={"payload": {"mass": 0.15}})
    s = np.zeros(arm.n)
    s[1] = 0.7
    M, K = (np.array(ca.Function("f", [arm.s], [ca.densify(e)])(s)) for e in (arm.M, ca.jacobian(arm.g, arm.s)))
    chain = lowest(K, M, 6)
    np.testing.assert_allclose(chain[:2], 0, atol=1e-4)
    approximations = []
    for count in COUNTS:
        model = Segments.of_links([ONE, TWO], count, 0.15)
        phi = np.where(np.arange(len(model.a)) >= model.first[1], 0.7, 0.0)
        approximations.append(lowest(model.stiffness(), model.mass(phi), 6)[2:])
    check(chain[2:], approximations, 4)


@pytest.mark.slow
@pytest.mark.parametrize("rate", thin([6.0, 0.0, 15.0]))
def test_stiffening_through_the_chain(rate):
    """The stretched-out arm spins with both joints locked: link 1 carries the pull of link 2 and of the payload."""
    effects = {"payload": {"mass": 0.15}, "geometric_stiffening": {}}
    arm = arm_of({**ONE, **LOADED}, {**TWO, **LOADED}, effects=effects)
    state = np.zeros(3 * arm.n)
    state[arm.n] = rate
    full = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)
    K = ca.Function("K", [full], [ca.densify(ca.jacobian(arm.residual, arm.s))])
    M = ca.Function("M", [arm.s], [arm.M])
    chain = lowest(np.array(K(state))[2:, 2:], np.array(M(np.zeros(arm.n)))[2:, 2:], 3)
    approximations = []
    for count in COUNTS:
        model = Segments.of_links([ONE, TWO], count, 0.15)
        locked = np.delete(np.eye(len(model.a)), model.first, axis=1)  # the elbow turns with the end of link 1
        locked[model.first[1], model.first[1] - 2] = 1.0
        K_n, M_n = (locked.T @ X @ locked for X in (model.spinning(rate), model.mass(np.zeros(len(model.a)))))
        approximations.append(lowest(K_n, M_n, 3))
    check(chain, approximations, 2)
