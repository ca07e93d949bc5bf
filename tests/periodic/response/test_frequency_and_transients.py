"""Harmonic transfer functions: rotated constant systems and square waves, whose sidebands are known; transients against SciPy's DOP853; and
what is refused."""

import numpy as np

import flexlin as fl
from tests.periodic.dense import at, integrate
from tests.periodic.systems import turned

A0, B0, C0 = np.array([[-0.2, 1.5], [-1.5, -0.3]]), np.array([[1.0], [0.4]]), np.array([[1.0, 2.0]])


def test_a_plant_in_turning_coordinates_answers_in_two_sidebands():
    """x = exp(J t) z, y = C0 x: with P+- = (I -+ i J) / 2 the answer at w + k is C0 P_k (i w - A0)^-1 B0."""
    J, (system, _) = np.array([[0.0, 1.0], [-1.0, 0.0]]), turned(A0, B0, C0, speed=1.0)
    omega = np.array([0.0, 0.7, 3.0])
    found = fl.frequency_response(system, C0, omega)
    for w, H in zip(omega, found.H[:, :, 0, 0], strict=True):
        z = np.linalg.solve(1j * w * np.eye(2) - A0, B0)
        exact = {k: (C0 @ (np.eye(2) - 1j * k * J) / 2 @ z).item() for k in (-1, 1)}
        for k, value in zip(found.orders, H, strict=True):
            assert abs(value - exact.get(int(k), 0.0)) <= found.error * np.abs(H).max() + 1e-13


def square(t):
    return np.where(np.mod(t, 1.0) < 0.5, 1.0, -1.0)[:, None, None]


def test_inputs_and_outputs_that_jump():
    """The waves of a square wave are 2 / (i pi k) for odd k, and 1 / (i w + 1) is what a lag makes of each."""
    w, lag = np.array([0.0, 3.0]), fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]], breaks=(0.0, 0.5))
    k = np.arange(-9, 10)
    waves = np.where(k % 2 == 1, 2 / (1j * np.pi * np.where(k, k, 1)), 0.0)
    seen = fl.frequency_response(lag, square, w)
    driven = fl.frequency_response(fl.PeriodicSystem([[-1.0]], 1.0, B=square, breaks=(0.0, 0.5)), [[1.0]], w)
    for found, shift in ((seen, w[:, None]), (driven, w[:, None] + 2 * np.pi * k)):
        near = found.H[:, np.abs(found.orders) <= 9, 0, 0]
        np.testing.assert_allclose(near, waves / (1j * shift + 1), atol=1e-8, rtol=0)


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

    start = np.array([0.4, -0.2])
    found = fl.respond(SYSTEM, T_END, x0=start, u=u, push=[0.3])
    exact = integrated(lambda t, x: at(A, t) @ x + at(B, t) @ at(u, t), start + 0.3 * B(T_END[:1])[0, :, 0])
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
