"""Frozen modes are followed by their shape: through crossings, along avoided ones, and into and out of rest."""

import numpy as np

from flexlin.periodic import follow_frozen_modes, stack_companion

T = np.linspace(0.0, 1.0, 129)
RNG = np.random.default_rng(7)


def state_matrices(K, D=0.0):
    """A(t) of y'' + D y' + K(t) y = 0."""
    n = K.shape[-1]
    return stack_companion(-K, np.broadcast_to(-D * np.eye(n), K.shape))


def lines(A):
    """The frequencies of the modes that oscillate somewhere, (N, k)."""
    found = follow_frozen_modes(A).frequencies
    return found[:, np.isfinite(found).any(axis=0)]


def test_modes_that_cross_go_straight_on_in_any_units():
    own = np.array([3.0 + 2 * T, 5.0 - 2 * T, 4.0 + 0 * T]).T  # all three meet at t = 1/2
    turn = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    K = np.einsum("ij,tj,kj->tik", turn, own**2, turn)
    units = (np.eye(6) + 0.3 * RNG.standard_normal((6, 6))) * 10.0 ** RNG.uniform(-2, 2, 6)
    for S in (np.eye(6), units):
        found = 2 * np.pi * lines(S @ state_matrices(K, 0.01) @ np.linalg.inv(S))
        assert found.shape == (129, 3)
        places = np.argsort(found[0])
        np.testing.assert_allclose(found[:, places], own[:, [0, 2, 1]], atol=1e-4)


def test_modes_that_turn_into_each_other_keep_their_order():
    a, b = 3.0 + 2 * T, 5.0 - 2 * T
    K = np.moveaxis(np.array([[a**2, 1.0 + 0 * T], [1.0 + 0 * T, b**2]]), -1, 0)
    found = np.sort(2 * np.pi * lines(state_matrices(K)), axis=1)
    np.testing.assert_allclose(2 * np.pi * lines(state_matrices(K)), found[:, np.argsort(np.argsort(found[0]))])
    np.testing.assert_allclose(found**2, np.linalg.eigvalsh(K), rtol=1e-9)


def test_a_mode_that_does_not_oscillate_has_no_frequency():
    """A pendulum that is turned over: it hangs for half of the time, and falls in the other half."""
    K = np.stack([np.diag([9.81 * np.cos(2 * np.pi * t), 400.0]) for t in T])
    found = follow_frozen_modes(state_matrices(K)).frequencies
    hanging = K[:, 0, 0] > 0
    assert (np.isfinite(found).sum(axis=1) == 1 + hanging).all()
    swing = np.sqrt(9.81 * np.cos(2 * np.pi * T[hanging])) / (2 * np.pi)
    np.testing.assert_allclose(np.nanmin(found[hanging], axis=1), swing)


def test_defective_matrices_are_followed():
    free = np.zeros((5, 2, 2))
    free[:, 0, 1] = 1.0  # a free body: its eigenvectors coincide
    assert np.isnan(follow_frozen_modes(free).frequencies).all()
