"""The Kalman filter against python-control and its Riccati equation."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.control import kalman_filter
from flexlin.errors import ArgumentError, NotDetectable
from tests.control.test_designs import pendulums

C = np.array([[1.0, 0.0, 0.0, 0.0]])
W, V = np.diag([0.0, 0.0, 0.5, 0.2]), np.array([[0.01]])


def test_constant_plant_gives_python_controls_filter():
    system = pendulums(0.0)
    L, P, _ = control.lqe(system.A(np.zeros(1))[0], np.eye(4), C, W, V)
    found = kalman_filter(system, C, W, V, tol=1e-11)
    t = np.array([0.0, 1.0, 4.0])
    assert np.abs(found.P(t) - P).max() < 1e-9 * np.abs(P).max()
    assert np.abs(found.L(t) - L).max() < 1e-9 * np.abs(L).max()


def test_covariance_obeys_its_equation_forward_in_time():
    system = pendulums()
    found = kalman_filter(system, C, W, V, tol=1e-10)

    def rate(t, p):
        P, A = p.reshape(4, 4), system.A(np.array([t]))[0]
        return (A @ P + P @ A.T - P @ C.T @ np.linalg.solve(V, C @ P) + W).ravel()

    stops = np.array([0.8, 2.0, np.pi, 3.9])
    run = solve_ivp(rate, (0, 4), found.P(np.zeros(1)).ravel(), "DOP853", stops, rtol=1e-11, atol=1e-13)
    assert np.abs(run.y.T.reshape(-1, 4, 4) - found.P(stops)).max() < 1e-7 * np.abs(found.P(stops)).max()


def test_unmeasured_mode_is_named():
    blind = fl.PeriodicSystem(np.diag([0.4, -1.0]), 1.0, np.ones((2, 1)))
    with pytest.raises(NotDetectable, match=r"not seen by the measurement; got real part of its exponent about 0\.4"):
        kalman_filter(blind, np.array([[0.0, 1.0]]), np.eye(2), np.eye(1))
    with pytest.raises(ArgumentError, match="C does not fit"):
        kalman_filter(blind, np.ones((1, 3)), np.eye(2), np.eye(1))
