"""The nonlinear judge: agreement with the linear model, energy, cost, attraction, feedforward, drives, sampled designs, failure."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import simpson

import flexlin as fl
from flexlin.control import feedforward, finite_horizon_lqr, horizon_system, linear_range, linearize_about, periodic_lqr
from flexlin.errors import ArgumentError, FlexlinError, SceneError
from flexlin.linearization import Law
from flexlin.periodic.sampled import Round, hold_plant
from flexlin.simulation import Drive, region_of_attraction, simulate
from tests.closed_arm import closed, opened


def test_linear_model_is_the_slope_of_the_nonlinear_one():
    """Without gravity the forcing is odd in the amplitude, so the first neglected terms are cubic: halving it divides the gap by 8."""
    weightless = {"effects.gravity.acceleration": 0.0}
    arms = (closed(changes=weightless | {"motion.joints.0.amplitude": size}) for size in (0.2, 0.1))
    gaps = [simulate(lin, 0.5, tol=1e-10).difference for lin in arms]
    assert gaps[0] / gaps[1] == pytest.approx(8.0, rel=0.05)


@pytest.mark.slow
def test_a_diverging_loop_is_told():
    lin = closed(changes={"control": {"feedforward": "none", "feedback": {"kind": "none"}}})
    with pytest.raises(FlexlinError):
        simulate(lin, periods=2, feedback=lambda t: np.full((len(t), 1, 6), -50.0))
    with pytest.raises(ArgumentError, match="initial"):
        simulate(lin, initial=np.zeros(3))
    assert isinstance(lin.arm.s, ca.SX)


DRIVEN = [
    (False, None, "the torque of the rigid motion alone"),
    (True, None, "the torque of the rigid motion and feedback"),
    (False, Law.constant([[0.0] * 6]), "no torque"),
    (False, Law.constant([[3.0, 0, 0, 0.5, 0, 0]]), "feedback alone"),
]


@pytest.mark.parametrize(("looped", "law", "words"), DRIVEN)
def test_it_says_what_moves_the_arm(looped, law, words):
    run = fl.simulate(closed() if looped else opened()[1], periods=0.02, tol=1e-4, law=law)
    assert run.driven_by == words
    assert f"driven by {words}" in run.summary()


@pytest.fixture(scope="module")
def lin():
    return closed()


def test_rigid_feedforward_is_the_scenes_own_law(lin):
    own, given = (simulate(lin, 0.5, feedforward=f) for f in (None, feedforward(lin, "rigid")))
    np.testing.assert_allclose(given.nonlinear, own.nonlinear, atol=1e-9)
    np.testing.assert_allclose(given.linear, own.linear, atol=1e-9)


def test_work_and_energy_balance(lin):
    assert simulate(lin, 1, tol=1e-9).energy_error < 1e-7
    loose = simulate(lin, 1, tol=1e-4).energy_error
    assert simulate(lin, 1, tol=1e-7).energy_error < loose


def test_periodic_lqr_costs_what_its_riccati_solution_says(lin):
    """About the exact elastic motion: cost until t plus cost to go x(t)' X(t) x(t) is x0' X(0) x0, in the nonlinear equations too."""
    reference = feedforward(lin, "joint-exact")
    plant = linearize_about(reference.motion, closed=False)
    Q, R = np.diag([10.0, 10.0, 10.0, 0.1, 0.1, 0.1]), np.array([[5.0]])
    made = periodic_lqr(plant, Q, R)
    z0 = 2e-4 * np.array([1.0, 0.1, 0.0, 0.0, 0.5, 0.0])
    run = simulate(lin, 0.25, reference.reference(np.zeros(1))[0] + z0, made.K, 1e-7, 1024, feedforward=reference)
    z = run.nonlinear - reference.reference(run.t)
    u = np.einsum("tij,tj->ti", made.K(run.t), z)
    spent = simpson(np.einsum("ti,ij,tj->t", z, Q, z) + np.einsum("ti,ij,tj->t", u, R, u), x=run.t)
    to_go = z[-1] @ made.X(run.t[-1:])[0] @ z[-1]
    assert spent > 0.5 * made.cost(z0)
    assert spent + to_go == pytest.approx(made.cost(z0), rel=1e-4)


@pytest.mark.slow
def test_a_fast_sampled_drive_tends_to_the_continuous_loop(lin):
    ideal = simulate(lin, 0.05, tol=1e-7)
    drives = (Drive(sample_time=h, delay=h / 2) for h in (0.001, 0.0005))
    held = (simulate(lin, 0.05, tol=1e-7, drive=drive) for drive in drives)
    gaps = [np.abs(run.nonlinear - ideal.nonlinear).max() for run in held]
    assert gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.slow
def test_nonlinear_share_grows_with_the_amplitude(lin):
    """For a small share the second order rules, so halving the share halves the amplitude; a linear arm has no border."""
    half, whole = linear_range(lin, 5e-4), linear_range(lin, 1e-3)
    np.testing.assert_allclose(whole.amplitudes, 2 * half.amplitudes, rtol=2e-2)
    assert "0.1 %" in whole.status
    attracted = region_of_attraction(lin, modes=1, periods=2, halvings=2)
    assert linear_range(lin, 0.1).amplitudes.min() < attracted.outside[0]
    mathieu = closed("spinning-link", {"effects.geometric_stiffening": "off"})
    assert np.isinf(linear_range(mathieu).amplitudes).all()


@pytest.mark.slow
def test_region_of_attraction_is_bracketed():
    """An arm that is held upright against gravity with little damping: beyond a good part of half a turn it is lost."""
    upright = {"control.feedback.kd": [0.1], "motion.joints": [{"mean": np.pi / 2, "amplitude": 0.2}]}
    found = region_of_attraction(closed(changes=upright), modes=1, periods=2, halvings=3, largest=3.0, tol=1e-5)
    assert 0 < found.inside[0] < found.outside[0] <= 3.0
    assert "come back" in found.status


@pytest.mark.slow
def test_drives_come_from_the_scene():
    changes = {"control.saturation": {"torque": [0.4]}, "control.sampling": {"period": 0.004, "delay": 0.001}}
    slow = closed(changes=changes)
    run = simulate(slow, 0.1, tol=1e-6)
    given = simulate(slow, 0.1, tol=1e-6, drive=Drive((0.4,), 0.004, 0.001))
    np.testing.assert_array_equal(run.nonlinear, given.nonlinear)
    assert np.abs(run.torque).max() <= 0.4
    with pytest.raises(SceneError, match=r"control\.saturation\.torque"):
        fl.load_scene("single-link", {"control.saturation": {"torque": [0.4, 1.0]}})


@pytest.mark.slow
def test_a_disturbed_one_way_move_costs_what_its_finite_horizon_design_says():
    """Two nonlinear runs of one move, one of them disturbed: the cost of their difference, its end included, is x0' X(0) x0."""
    move = {"kind": "point-to-point", "course": "one-way", "joints": [{"waypoints": [-1.2, -0.4]}]}
    move |= {"move_time": 0.6, "dwell_time": 0.2}
    _, arm = opened(changes={"motion": move, "designs": []})
    Q, R, end = np.diag([10.0, 10.0, 10.0, 0.1, 0.1, 0.1]), np.array([[10.0]]), np.diag([5.0, 5.0, 5.0, 0.1, 0.1, 0.1])
    made = finite_horizon_lqr(horizon_system(arm), Q, R, end=end, tol=1e-7)
    x0 = 1e-3 * np.array([1.0, 0.1, 0.0, 0.0, 0.5, 0.0])
    calm, pushed = (simulate(arm, 1, start, made.K, 1e-7, 1024) for start in (np.zeros(6), x0))
    z = pushed.nonlinear - calm.nonlinear
    u = np.einsum("tij,tj->ti", made.K(calm.t), z)
    running = np.einsum("ti,ij,tj->t", z, Q, z) + np.einsum("ti,ij,tj->t", u, R, u)
    assert simpson(running, x=calm.t) + z[-1] @ end @ z[-1] == pytest.approx(made.cost(x0), rel=0.02)


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
    plant = hold_plant(made.system, Round(made.system.period, SAMPLES, 1), 0.0, 1e-10, 6)
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
        (ArgumentError, "limit", lambda: Drive(limit=(-1.0,))),
        (ArgumentError, "delay", lambda: Drive(sample_time=0.01, delay=0.02)),
        (ArgumentError, "delay", lambda: Drive(delay=0.01)),
        (ArgumentError, "where a device samples", lambda: Drive(encoders=(1e-3,))),
        (ArgumentError, "encoders do not fit", lambda: run(arm, np.zeros(4), encoders=(1e-3, 1e-3))),
        (SceneError, "one for each torque-driven joint", lambda: fl.load_scene("single-link", twice)),
        (SceneError, "a delay of 0 to the period", lambda: fl.load_scene("single-link", late)),
        (ArgumentError, "held before", lambda: delayed.law),
    ):
        with pytest.raises(error, match=words):
            call()
    lin = closed("single-link", {**CHANGES, "control.sampling": {"period": 0.01, "torque": [1e-2]}})
    found = simulate(lin, 0.05, tol=1e-4).torque
    np.testing.assert_allclose(found / 1e-2, np.round(found / 1e-2), atol=1e-9)
