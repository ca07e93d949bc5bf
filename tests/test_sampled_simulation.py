"""Sampled designs on the nonlinear arm: its own period map beside the multipliers, and what rounded readings and torques do to it."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic.sampled import hold_plant
from flexlin.simulation import Drive, simulate
from tests.closed_arm import closed

SAMPLES = 25
CHANGES = {"links.0.modes": 1, "designs": [], "control.feedback": {"kind": "none"}}


def make_arm(share=1.0):
    loads = {"effects.gravity.acceleration": 9.81 * share, "motion.joints.0.amplitude": 0.5 * share}
    lin = closed("single-link", CHANGES | loads)
    system = lin.periodic_system()
    return lin, fl.sampled_lqr(system, np.diag([9.0, 9.0, 0.1, 0.1]), 2.0, system.period / SAMPLES)


@pytest.fixture(scope="module")
def arm():
    return make_arm()


def run(arm, initial, **steps):
    lin, made = arm
    drive, law = Drive(sample_time=made.sample_time, **steps), lin.law.with_gain(made.gain)
    return simulate(lin, 1.0, initial, tol=1e-8, points_per_period=SAMPLES, drive=drive, law=law)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "within"), [(1.0, 5e-3), (1 / 16, 5e-5)])
def test_the_nonlinear_period_map_has_the_multipliers_of_the_design(share, within):
    """But for what the loads bend: with a sixteenth of them the rates differ by a two hundredth as much, as squares do."""
    arm, step = make_arm(share), 1e-4
    still, *moved = (run(arm, x).nonlinear[-1] for x in (np.zeros(4), *(step * np.eye(4))))
    found = np.linalg.eigvals((np.array(moved) - still).T / step)
    rates, known = (np.sort(np.log(np.abs(one))) for one in (found, arm[1].floquet().multipliers))
    np.testing.assert_allclose(rates, known, rtol=within)


@pytest.mark.slow
def test_rounding_moves_the_arm_no_further_than_its_loop_lets_it(arm):
    """|x_k| <= sum over j of |Phi_kj G_j| (|K_j| e / 2 + s / 2) for steps e of the encoder and s of the torque."""
    made = arm[1]
    encoder, torque = 2e-3, 5e-3
    plant = hold_plant(made.system, SAMPLES, 1, 0.0, 1e-10, 6)
    bound, maps = np.zeros(4), []
    for F, G, K in zip(plant.F, plant.G, made.K, strict=True):
        maps = [(F - G @ K) @ one for one in maps] + [G]
        wide = np.abs(K[:, :1]) * encoder / 2 + torque / 2  # the encoder reads the joint alone
        bound = sum(np.abs(one) @ np.full(1, wide.max()) for one in maps)
    exact = run(arm, np.zeros(4))
    rounded = run(arm, np.zeros(4), encoders=(encoder,), steps=(torque,))
    apart = np.abs(rounded.nonlinear - exact.nonlinear)[-1]
    assert np.all(apart <= 1.05 * bound)
    assert apart.max() > 1e-6
    np.testing.assert_allclose(rounded.torque / torque, np.round(rounded.torque / torque), atol=1e-9)


def test_steps_need_samples_and_one_number_a_motor(arm):
    system, period = arm[1].system, arm[1].sample_time
    twice = {"control.sampling": {"period": 0.01, "encoders": [1e-3, 1e-3]}}
    late = {"control.sampling": {"period": 0.01, "delay": 0.02}}
    delayed = fl.sampled_lqr(system, np.eye(4), 1.0, period, period / 2)
    for error, words, call in (
        (fl.errors.ArgumentError, "where a device samples", lambda: Drive(encoders=(1e-3,))),
        (fl.errors.ArgumentError, "encoders do not fit", lambda: run(arm, np.zeros(4), encoders=(1e-3, 1e-3))),
        (fl.errors.SceneError, "one for each torque-driven joint", lambda: fl.load_scene("single-link", twice)),
        (fl.errors.SceneError, "a delay of 0 to the period", lambda: fl.load_scene("single-link", late)),
        (fl.errors.ArgumentError, "held before", lambda: delayed.law),
    ):
        with pytest.raises(error, match=words):
            call()
    lin = closed("single-link", {**CHANGES, "control.sampling": {"period": 0.01, "torque": [1e-2]}})
    found = simulate(lin, 0.05, tol=1e-4).torque
    np.testing.assert_allclose(found / 1e-2, np.round(found / 1e-2), atol=1e-9)
