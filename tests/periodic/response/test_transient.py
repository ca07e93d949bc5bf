"""Transients against SciPy's DOP853 and closed forms."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ArgumentError
from tests.periodic.dense import at, integrate

T_END = np.linspace(0.3, 11.0, 23)


def A(t):
    out = np.zeros((len(t), 2, 2))
    out[:, 0, 1], out[:, 1, 1] = 1.0, np.where(np.mod(t, 2.0) < 0.7, -0.1, -0.6)
    out[:, 1, 0] = -2.0 - 0.8 * np.cos(np.pi * t)
    return out


def B(t):
    return np.stack([0.2 * np.sin(np.pi * t), 1.0 + 0 * t], axis=1)[:, :, None]


SYSTEM = fl.PeriodicSystem(A, 2.0, B=B, breaks=(0.0, 0.7))


def integrated(rate, start):
    """At T_END, between all jumps."""
    jumps = np.add.outer(2.0 * np.arange(6), [0.0, 0.7]).ravel()
    stops = np.unique([*T_END, *jumps[(jumps > T_END[0]) & (jumps < T_END[-1])]])
    return integrate(rate, start, stops)[np.isin(stops, T_END)]


def test_states_from_a_state_a_push_and_an_input():
    def u(t):
        return np.sin(1.7 * t)[:, None]

    def rate(t, x):
        return at(A, t) @ x + at(B, t) @ at(u, t)

    start = np.array([0.4, -0.2])
    found = fl.respond(SYSTEM, T_END, x0=start, u=u, push=[0.3])
    exact = integrated(rate, start + 0.3 * B(T_END[:1])[0, :, 0])
    np.testing.assert_allclose(found.x, exact, atol=1e-8)
    assert np.abs(found.x - exact).max() <= found.error * np.abs(exact).max() + 1e-10
    assert not found.covariance.any()


def test_noise_spreads_the_states():
    def rate(t, P):
        whole = at(A, t) @ P
        return whole + whole.T + 0.5 * at(B, t) @ at(B, t).T

    found = fl.respond(SYSTEM, T_END, noise=[[0.5]])
    np.testing.assert_allclose(found.covariance, integrated(rate, np.zeros((2, 2))), atol=1e-8)
    assert not found.x.any()


def test_what_does_not_fit_is_refused():
    with pytest.raises(ArgumentError, match="does not increase"):
        fl.respond(SYSTEM, [1.0, 0.5])
    with pytest.raises(ArgumentError, match="no input"):
        fl.respond(fl.PeriodicSystem([[-1.0]], 1.0), [0.0, 1.0], u=[1.0])
