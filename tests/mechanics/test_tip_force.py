"""Loads at the tip against closed forms: columns that buckle and flutter, prestressed frequencies, a pendulum under a force.

A unit column l = EI = rhoA = 1, clamped at its base; eight clamped-free modes come from above to within 1.3e-4 of its buckling load.
"""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigvals
from scipy.optimize import brentq, root
from scipy.special import jv

import flexlin as fl
from flexlin.checks import Array
from flexlin.motion import SampledMotion

from .scenes import arm_of, held, linear, plain_scene, scene_of, value

UNIT = {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0}


def column(effects: dict[str, Any], angle: float = 0.0) -> tuple[Array, Array]:
    """M and K of the unit column with eight modes, its joint held at an angle."""
    lin = linear(plain_scene([{**UNIT, "modes": 8}], held(angle), effects={"geometric_stiffening": {}, **effects}))
    return lin.M(0.0), lin.K(0.0)


def push(load: float, frame: str = "world", angle: float = 0.0) -> dict[str, Any]:
    """A force against the column's axis."""
    x, y = (1.0, 0.0) if frame == "tip" else (np.cos(angle), np.sin(angle))
    return {"tip_force": {"force": [-load * x, -load * y, 0.0], "frame": frame}}


def smallest_load(loaded: dict[str, Any], angle: float = 0.0) -> float:
    """The smallest P with det(K_0 + P (K_1 - K_0)) = 0: K is linear in the load."""
    bare = column({}, angle)[1]
    found = eigvals(bare, bare - column(loaded, angle)[1])
    return float(found[(abs(found.imag) < 1e-9) & (found.real > 0)].real.min())


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_euler_buckling(angle):
    """P = pi^2 EI / (4 l^2), at any angle of the column against the world."""
    assert 0 < smallest_load(push(1.0, angle=angle), angle) / (np.pi**2 / 4) - 1 < 1.3e-4


def test_buckling_under_the_own_weight():
    """q l^3 = 7.8373 EI, where J_-1/3(2/3 sqrt(q)) = 0 (Greenhill 1881)."""
    exact = brentq(lambda q: jv(-1 / 3, 2 / 3 * np.sqrt(q)), 7.0, 8.5)
    assert 0 < smallest_load({"gravity": {"acceleration": 1.0, "direction": [-1.0, 0.0, 0.0]}}) / exact - 1 < 1e-5


def test_beck_column():
    """A follower never buckles the column; at P = 20.05 EI/l^2 two frequencies meet at omega = 11.02 (Beck 1952)."""
    (M, bare), (_, unit) = column({}), column(push(1.0, "tip"))

    def squares(load: float) -> Array:
        found = eigvals(bare + load * (unit - bare), M)
        return found[np.argsort(found.real)]

    low, high = 10.0, 30.0
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (low, middle) if abs(squares(middle)[:2].imag).max() > 1e-6 else (middle, high)
    assert low == pytest.approx(20.0509, rel=1e-4)
    assert np.sqrt(squares(low)[0].real) == pytest.approx(11.016, rel=1e-3)
    assert all(np.linalg.det(bare + load * (unit - bare)) > 0 for load in np.linspace(0.0, 20.0, 9))


def shaken() -> fl.Scene:
    """A unit column with one mode, its joint held, under a harmonic of a motion of 0.4 s."""
    load = {"force": [0.0, 1e-3, 0.0], "harmonic": 3, "phase": 0.4}
    effects = {"tip_force": load, "modal_damping": {"ratio": 0.1}}
    return plain_scene([{**UNIT, "modes": 1}], held(frequency=2.5), effects=effects)


def test_a_periodic_force_shakes_a_beam():
    """w = Re(X(l) F e^(i (3 W t + phase)) / (w1^2 - (3 W)^2 + 2 i z w1 3 W)), X(l) = 2, w1 = 1.8751^2; simulated, too."""
    lin, t = linear(shaken()), np.linspace(0.0, 0.4, 9)
    W, w1 = 3 * 2 * np.pi * 2.5, 1.8751040687119611**2
    phasor = 2e-3 * np.exp(1j * (W * t + 0.4)) / (w1**2 - W**2 + 0.2j * w1 * W)
    expected = np.stack([phasor.real, (1j * W * phasor).real], axis=1)
    np.testing.assert_allclose(fl.forced_response(lin.periodic_system(), lin.forcing)(t), expected, atol=1e-12)
    run = fl.simulate(lin, 1.0, initial=expected[0], tol=1e-9, points_per_period=8)
    np.testing.assert_allclose(run.nonlinear, expected, atol=1e-8)
    assert run.energy_error < 1e-5


def test_a_periodic_force_along_a_motion_of_numbers():
    """What the place on the motion is passed by, a phase or angles, makes no difference; nor does one equation or all."""
    scene = shaken()
    arm, t = fl.build_manipulator(scene), np.array([0.0, 0.05, 0.31])
    still = SampledMotion(1, 0.4, (True,), sampler=lambda t: (np.zeros((len(t), 1)),) * 3)
    by_phase, by_angles = fl.linearize(arm, scene.motion), fl.linearize(arm, still)
    np.testing.assert_allclose(by_angles.h(t), by_phase.h(t), atol=1e-15)
    np.testing.assert_allclose(by_phase.h(t)[:, 0], 2e-3 * np.cos(6 * np.pi * t / 0.4 + 0.4), rtol=1e-10)
    whole = by_phase.about.of_arm("residual", t, *np.zeros((3, 3, 1)))
    np.testing.assert_allclose(whole[:, 1, 0], -by_phase.h(t)[:, 0], rtol=1e-12)


def test_a_load_grows_with_the_square_of_the_first_joints_rate():
    """The torque F l (q'/r)^2 of a rigid link, alike to and fro; about a rotation it is D_L = -2 F l Omega/r^2."""
    load = {"tip_force": {"force": [0.0, 2.0, 0.0], "frame": "tip", "rate": 3.0}}
    arm = arm_of({"length": 0.7, "modes": 0}, effects=load)
    for rate in (-6.0, 0.0, 1.5):
        assert value(arm, "damping", [0.4], [rate]).item() == pytest.approx(-2.0 * 0.7 * (rate / 3) ** 2, abs=1e-15)
    lin = fl.linearize(arm, {"kind": "rotation", "joints": [{"rate": -5.0}]})
    assert lin.D(0.1).item() == pytest.approx(2 * 2.0 * 0.7 * 5.0 / 9, rel=1e-13)


def test_a_force_across_a_cantilever_bends_it_into_the_elastica():
    """Both components of the tip's way at P l^2/EI = 1, 2, 5, 10 (Bisshopp, Drucker 1945; Mattiasson 1981)."""
    load = {"geometric_stiffening": {}, "tip_force": {"force": [0.0, 1.0, 0.0]}}
    arm = fl.build_manipulator(scene_of({**UNIT, "modes": 6}, effects=load), ["effects.tip_force.force.1"])
    residual, points, still = arm.functions["residual"], arm.functions["points"], np.zeros(arm.n)
    found = []
    for P in (1.0, 2.0, 5.0, 10.0):
        bent = root(lambda w, P=P: residual([0.0, *w], still, still, P).full()[1:, 0], np.zeros(6), tol=1e-10)
        assert bent.success
        found.append(points([0.0, *bent.x], P).full()[:, -1])
    across, along = [0.30172, 0.49346, 0.71379, 0.81061], [0.05643, 0.16064, 0.38763, 0.55500]
    np.testing.assert_allclose(found, np.column_stack([1 - np.array(along), across]), atol=7e-5)
