"""Transients against SciPy's DOP853 and closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.errors import ArgumentError

T_END = np.linspace(0.3, 11.0, 23)


def A(t):
    out = np.zeros((len(t), 2, 2))
    out[:, 0, 1], out[:, 1, 1] = 1.0, np.where(np.mod(t, 2.0) < 0.7, -0.1, -0.6)
    out[:, 1, 0] = -2.0 - 0.8 * np.cos(np.pi * t)
    return out


def B(t):
    return np.stack([0.2 * np.sin(np.pi * t), 1.0 + 0 * t], axis=1)[:, :, None]


SYSTEM = fl.PeriodicSystem(A, 2.0, B=B, breaks=(0.0, 0.7))


def integrate(rate, start):
    """Between all jumps, by DOP853."""
    stops = np.unique(np.concatenate([T_END, *[2.0 * k + np.array([0.0, 0.7]) for k in range(6)]]))
    stops = stops[(stops >= T_END[0]) & (stops <= T_END[-1])]
    y, found = np.asarray(start, float), {T_END[0]: start}
    for a, b in pairwise(stops):
        middle = 1e-12 * (b - a)
        y = solve_ivp(rate, (a + middle, b - middle), y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        found[b] = y
    return np.array([found[t] for t in T_END])


def test_states_from_a_state_a_push_and_an_input():
    def u(t):
        return np.sin(1.7 * t)[:, None]

    def rate(t, x):
        now = np.array([t])
        return A(now)[0] @ x + B(now)[0] @ u(now)[0]

    start = np.array([0.4, -0.2])
    found = fl.respond(SYSTEM, T_END, x0=start, u=u, push=[0.3])
    exact = integrate(rate, start + 0.3 * B(T_END[:1])[0, :, 0])
    np.testing.assert_allclose(found.x, exact, atol=1e-8)
    assert np.abs(found.x - exact).max() <= found.error * np.abs(exact).max() + 1e-10
    assert not found.covariance.any()


def test_noise_spreads_the_states():
    def rate(t, y):
        now, P = np.array([t]), y.reshape(2, 2)
        whole = A(now)[0] @ P
        return (whole + whole.T + 0.5 * B(now)[0] @ B(now)[0].T).ravel()

    found = fl.respond(SYSTEM, T_END, noise=[[0.5]])
    np.testing.assert_allclose(found.covariance.reshape(-1, 4), integrate(rate, np.zeros(4)), atol=1e-8)
    assert not found.x.any()


def test_what_does_not_fit_is_refused():
    with pytest.raises(ArgumentError, match="does not increase"):
        fl.respond(SYSTEM, [1.0, 0.5])
    with pytest.raises(ArgumentError, match="no input"):
        fl.respond(fl.PeriodicSystem([[-1.0]], 1.0), [0.0, 1.0], u=[1.0])
