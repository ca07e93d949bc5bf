"""Sensors: against finite differences of positions and the beam's own shape; the zeros from motors to tip against SciPy's pencil."""

from typing import get_args

import numpy as np
import pytest
from scipy.linalg import eigvals

import flexlin as fl
from flexlin.analyses import analyse
from flexlin.control import bending, tip_acceleration, tip_position
from flexlin.control.sensors import READINGS, tip_zeros
from flexlin.errors import ArgumentError
from flexlin.report.advice import comment_on_zeros
from flexlin.scene.scene import Sensor
from flexlin.simulation import tip_positions
from tests.closed_arm import closed, opened


@pytest.fixture(scope="module")
def scene():
    return fl.load_scene("single-link")


@pytest.fixture(scope="module")
def lin(scene):
    return fl.linearize(fl.build_manipulator(scene), scene.motion)


def test_strain_gauge_at_the_root_of_a_cantilever(scene, lin):
    """X'' = 2 (beta l)^2 / l^2 at the root, 0 at the free end, for every clamped-free mode (Blevins, Formulas, ch. 8)."""
    beta = np.array([1.8751040687119611, 4.694091132974174])
    root, end = (bending(scene, lin, 0, at)(np.zeros(1))[0, 0] for at in (0.0, 1.0))
    np.testing.assert_allclose(root[1:3], 2 * beta**2 / 0.96**2, rtol=1e-10)
    np.testing.assert_allclose(end, 0.0, atol=1e-9)
    with pytest.raises(ArgumentError, match="not on the link"):
        bending(scene, lin, 0, 1.5)


def test_camera_sees_the_slope_of_the_tips_position(lin):
    t = np.array([0.1, 0.7, 1.6])
    C, step = tip_position(lin)(t), 1e-6
    for k in range(lin.n):
        moved = np.zeros((3, lin.n))
        moved[:, k] = step
        slope = (tip_positions(lin, t, moved) - tip_positions(lin, t, -moved)) / (2 * step)
        np.testing.assert_allclose(C[:, :, k], slope, atol=1e-8)


def test_accelerometer_is_the_second_derivative_of_the_camera(lin):
    """Along a linear motion under a constant torque: second differences of C_position x by central differences of exact steps."""
    from flexlin.periodic import gauss_transitions

    system, torque, h = lin.periodic_system(), 0.3, 1e-4

    def driven(t):
        A = np.zeros((len(t), 7, 7))
        A[:, :6, :6], A[:, :6, 6] = system.A(t), system.B(t)[:, :, 0] * torque
        return A

    t = 0.4 + h * np.arange(3)
    x = [np.array([0.02, 0.01, -0.003, 0.1, 0.2, -0.1, 1.0])]
    for step in gauss_transitions(driven, t, 8):
        x.append(step @ x[-1])
    seen = np.einsum("tij,tj->ti", tip_position(lin)(t), np.array(x)[:, :6])
    C, D = tip_acceleration(lin)
    felt = (C(t) @ np.array(x)[:, :6, None])[1, :, 0] + D(t)[1, :, 0] * torque
    np.testing.assert_allclose((seen[0] - 2 * seen[1] + seen[2]) / h**2, felt, rtol=0, atol=1e-4 * np.abs(felt).max())


def test_every_sensor_that_a_log_may_name_is_read():
    """A kind that only the scene's schema knows would end in a KeyError."""
    assert set(get_args(Sensor)) - {"coordinate", "rate"} <= set(READINGS)


STILL = {"designs": [], "motion.joints": [{"mean": 0.0, "amplitude": 0.0}]}


def test_a_link_at_rest_has_the_zeros_of_rosenbrocks_pencil():
    _, lin = opened(changes=STILL)
    n, t = lin.n, np.zeros(1)
    K, D = (np.linalg.solve(lin.M(0.0), part) for part in (lin.K(0.0), lin.D(0.0)))
    C = fl.control.tip_position(lin)(t)[0]
    row = C[:, :1].T @ C
    pencil, mass = np.zeros((2, 2 * n + 1, 2 * n + 1))
    pencil[:n, n : 2 * n], mass[:n, :n] = np.eye(n), np.eye(n)
    pencil[n : 2 * n] = np.column_stack([-K, -D, lin.periodic_system().B(t)[0, n:]])
    mass[n : 2 * n, n : 2 * n], pencil[2 * n :, : 2 * n] = np.eye(n), row
    known = eigvals(pencil, mass)
    known = known[np.abs(known) < 1e5]
    found = tip_zeros(lin)
    assert found.verdict == "non-minimum phase"
    np.testing.assert_allclose(np.sort(found.exponents.real), np.sort(known.real), rtol=1e-6, atol=1e-8)


def test_a_report_names_the_zero_that_bounds_every_controller():
    scene = fl.load_scene("single-link", {"designs": [], "links.0.modes": 1})
    found = analyse(scene)
    assert found.zeros.verdict == "non-minimum phase"
    exact = tip_zeros(found.plant)
    assert np.all(np.abs(found.zeros.exponents.real - exact.exponents.real) <= found.zeros.errors + exact.errors)
    assert "non-minimum phase" in next(comment_on_zeros(found))


@pytest.mark.slow
def test_rounding_of_an_outputs_derivatives_is_not_chased():
    """A slow pick-and-place: narrower and narrower panels followed it, until none was left to try."""
    found = tip_zeros(closed("pick-and-place", {"motion.move_time": 1.0, "motion.dwell_time": 1.0}))
    assert found.verdict == "non-minimum phase"
    assert found.exponents[0].real == pytest.approx(3222, abs=1)
