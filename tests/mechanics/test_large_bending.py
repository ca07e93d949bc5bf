"""Links that bend far: positive kinetic energy, the energy that a swing keeps, and the second order of small bending."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import builtin_scenes
from tests.thinned import thin

from .scenes import LINK, arm_of, scene_of
from .test_jury import random_scene

STIFFENED = {"geometric_stiffening": {}}
THIN = {"length": 1.0, "mass_per_length": 0.162, "bending_stiffness": 1.4}


def light_arm(seed):
    """A thin link without a hub, on any axis in space or in the plane, that carries another; sections up to a fifth as high as long.

    From 12 on, odd ones are coupled by twist without being shortened.
    """
    rng = np.random.default_rng(seed)
    space, n, height = bool(seed % 2), int(rng.integers(1, 7)), rng.choice([0.01, 0.2])
    about_y, about_z = (height * rng.uniform(0.3, 1.0, 2)) ** 2
    modes = {"y": n, "z": int(rng.integers(1, 4)), "torsion": int(rng.integers(0, 4))} if space else n
    more = {"bending_stiffness": [1.4, 2.3], "torsional_stiffness": 1.0, "polar_inertia": 0.162 * (about_y + about_z)}
    axis = [[0, 0, 1], [1, 0, 0], rng.normal(size=3).tolist()][rng.integers(3)]
    effects = {**STIFFENED, "payload": {"mass": float(0.16 * rng.uniform(0, 1))}}
    if rng.random() < 0.7:
        effects["rotary_inertia"] = {"radius_of_gyration": [float(about_z**0.5), 0.0]}
    if space and (rng.random() < 0.7 or seed > 12):
        effects["bending_torsion_coupling"] = {}
    if space and seed > 12:
        modes["torsion"] = max(modes["torsion"], 1)
        del effects["geometric_stiffening"]
    first = {**THIN, "modes": modes, **({**more, "axis": axis} if space else {})}
    return arm_of(first, {**THIN, "modes": 2}, effects=effects), rng


@pytest.mark.slow
@pytest.mark.parametrize("seed", thin([13, *range(12), *range(15, 25, 2)], quick=4))
def test_the_mass_matrix_is_positive_definite_however_far_a_link_bends(seed):
    """Random light links in the plane and in space, 1 to 6 modes, no hub, tips bent by 2 to 30 % of the length."""
    arm, rng = light_arm(seed)
    for _ in range(10):
        w = rng.normal(size=arm.n)
        w *= rng.uniform(0.02, 0.3) / 2 / np.abs(w[2:]).sum()
        w[:2] = rng.uniform(-3, 3, 2)
        M = arm.functions["M"](w, []).full()
        scale = 1 / np.sqrt(np.diag(M))
        assert np.linalg.eigvalsh(M * np.outer(scale, scale))[0] > 1e-9
        np.testing.assert_allclose(M, M.T, atol=1e-14 * np.abs(M).max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 5, 13, 15, 103])
def test_light_links_swing_to_the_end_and_keep_their_energy(seed):
    """The same links, bent in all their shapes and let go without damping; the last took steps so short that they lost its motion."""
    arm, rng = light_arm(seed)
    w = np.r_[0.0, 0.0, rng.normal(size=arm.n - 2)]
    w *= rng.uniform(0.02, 0.3) / 2 / np.abs(w).sum()
    lin = fl.linearize(arm, scene_of(THIN, THIN).motion)
    run = fl.simulate(lin, 0.03, initial=np.r_[w, 0 * w], tol=1e-7, points_per_period=256)
    assert np.abs(run.nonlinear[:, 2 : arm.n]).max() > 0.5 * np.abs(w).max()
    assert run.energy_error < 1e-8
    assert run.error < 1e-7


@pytest.mark.slow
def test_a_payload_that_may_vanish_and_a_link_that_bends_upward_alone():
    """Free numbers give what written ones do, also a payload of no mass whose centre lies beyond the tip."""
    for mass in (0.0, 0.2):
        links = {**THIN, "modes": {"z": 2}, "bending_stiffness": [1.4, 2.3]}, {**THIN, "modes": 2}
        effects = {**STIFFENED, "gravity": {}, "payload": {"mass": 0.2, "offset": 0.1, "inertia": 1e-3}}
        scene = scene_of(*links, effects=effects)
        free = fl.build_manipulator(scene, ["effects.payload.mass"])
        written = arm_of(*links, effects={**effects, "payload": {**effects["payload"], "mass": mass}})
        state = np.random.default_rng(0).normal(size=(2, free.n)) * np.r_[1, 1, np.full(free.n - 2, 0.05)]
        for name, at in (("M", state[:1]), ("energy", state)):
            one, other = free.functions[name](*at, [mass]).full(), written.functions[name](*at, []).full()
            np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-13)


OPEN = [name for name in builtin_scenes() if "geometric_stiffening" in fl.load_scene(name).effects.on()]
TREES = (0, 2, 3, 6, 7, 19, 36, 42, 45, 50, 41, 65, 75, 123)
"""Random scenes with the effect: tapered links, shear, and sections with inertia are among them; the last four twist without it."""


@pytest.mark.slow
@pytest.mark.parametrize("case", thin([*OPEN, *TREES], quick=4))
def test_to_first_order_the_curve_is_the_energy_of_second_order(case):
    """Residual and slopes of both forms of the equations agree on a rigid motion: they share neither integrals nor kinematics."""
    scene = fl.load_scene(case) if isinstance(case, str) else random_scene(case)
    arm = fl.build_manipulator(scene)
    assert arm is not arm.near
    lin, rng = fl.linearize(arm, scene.motion), np.random.default_rng(0)
    state = [part[0] for part in lin.about.positions(rng.uniform(0, lin.period, 1), *np.zeros((3, 1, lin.n)))]
    found = []
    for form in (arm, arm.near):
        by = ca.vertcat(form.s, form.s_dot, form.s_ddot)
        phase = ca.SX.sym("phase") if form.phase is None else form.phase
        inputs, outputs = [by, form.parameters.symbols, phase], [ca.jacobian(form.residual, by), form.residual]
        slopes = ca.Function("slopes", inputs, outputs)(np.concatenate(state), form.parameters.values, 0.3)
        found.append([part.full() for part in slopes])
    for curve, second in zip(*found, strict=True):
        np.testing.assert_allclose(curve, second, atol=1e-12 + 1e-8 * np.abs(second).max())


def test_scenes_without_the_effect_pay_nothing():
    arm = arm_of({**LINK, "modes": 2}, effects={"payload": {"mass": 0.1}})
    assert arm.near is arm
