"""Integrals and filters of a scene's feedback as states of its loop, against states and integrations written here."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin import linearize
from flexlin.analyses import answer_noise, respond, state_disturbance
from flexlin.control import linearize_about, periodic_motion
from flexlin.errors import ArgumentError, SceneError
from flexlin.periodic import extend_system
from flexlin.scene import get_value
from tests.closed_arm import closed
from tests.control.test_c_controllers import FILTERS as TWO
from tests.control.test_c_controllers import PID
from tests.test_simulation_sticking import BLOCK

KP, KD, KI = (PID[name][0] for name in ("kp", "kd", "ki"))
FILTERS = [TWO[0], {"kind": "low-pass", "cutoff": 200.0}, TWO[1]]
CONTROLLED = {"designs": [], "control.feedback": PID, "control.filters": FILTERS}


def loop_of(changes=None, name="single-link"):
    return closed(name, CONTROLLED | (changes or {}))


def state_matrices(plant, t):
    """A of [y; y'; integral; rate filter; low-pass w, w'; notch v, v'] (N, 12, 12), in states that flexlin does not use."""
    c, a, b, d = plant.sample(t), *(2 * np.pi * np.array([35.0, 200.0, 4.5]))
    A = np.zeros((len(t), 12, 12))
    A[:, :3, 3:6] = np.eye(3)
    A[:, 3:6, :3], A[:, 3:6, 3:6] = -np.linalg.solve(c.M, c.K), -np.linalg.solve(c.M, c.D)
    A[:, 6, 0] = 1.0
    A[:, 7, [3, 7]] = a, -a
    A[:, 8, 9] = A[:, 10, 11] = 1.0
    A[:, 9, [0, 7, 6, 8, 9]] = KP * b**2, KD * b**2, KI * b**2, -(b**2), -np.sqrt(2) * b
    A[:, 11, [8, 11, 10]] = 1.0, -2 * 0.3 * d, -(d**2)
    torque = -(A[:, 11] + np.array([2 * 0.2 * 0.3 * d, d**2]) @ np.eye(12)[[11, 10]])
    A[:, 3:6] += np.linalg.solve(c.M, c.B) @ torque[:, None]
    return A


def test_a_moving_loop_has_the_eigenvalues_of_its_filters_in_other_states():
    """The two forms differ by a constant change of states, so their eigenvalues agree at every time."""
    lin = loop_of()
    t = np.array([0.0, 0.37, 1.1])
    found, wanted = (np.linalg.eigvals(A) for A in (lin.A(t), state_matrices(linearize(lin.arm, lin.motion), t)))
    assert found.shape == (3, 6 + 6)
    off = np.abs(found[:, :, None] - wanted[:, None]).min(axis=1) / np.maximum(1.0, np.abs(wanted))
    assert off.max() < 1e-9
    assert fl.floquet(lin.periodic_system()).verdict == "stable"


def test_integral_action_leaves_no_mean_error_behind_a_constant_torque():
    """The forced response and the nonlinear periodic motion: the joint's mean error is zero, that of the PD is not."""
    bent = loop_of({"control.feedforward": "none"})
    response = fl.forced_response(bent.periodic_system(), bent.forcing)
    t = bent.period * np.arange(64) / 64
    assert abs(response(t)[:, 0].mean()) < 1e-9 < 1e-3 < np.abs(response(t)[:, 0]).max()
    motion = periodic_motion(bent)
    assert abs(motion(t)[:, 0].mean()) < 1e-12
    z = motion.loop_state(t)
    asked = bent.law.torque(t, z)
    np.testing.assert_allclose(asked, motion.torque(t), atol=1e-6 * np.abs(asked).max())


def step_by_step(lin, limit, t, start):
    """States [y; y'; z; work] (N, ..) by SciPy's LSODA, whose steps pass over the corners of the torque."""
    about, controller, n = lin.about, lin.law.controller, lin.n

    def rate(now, z):
        x, asked, at = z[:-1], lin.law.torque(np.array([now]), z[None, :-1])[0], np.array([now])
        given = np.clip(asked, -limit, limit)
        moved, force = (x[None, :n], x[None, n : 2 * n]), lin.B(now) @ given
        M, d = about.of_arm("M", at, moved[0])[0], about.of_arm("damping", at, *moved)[0, :, 0]
        rest = about.of_arm("residual", at, *moved, np.zeros((1, n)))[0, :, 0]
        power = about.positions(at, *moved)[1][0] @ (force - d)
        remembered = x[:0] if controller is None else controller.rates @ x + controller.unwinding @ (asked - given)
        return np.concatenate([x[n : 2 * n], np.linalg.solve(M, force - rest), remembered, [power]])

    return solve_ivp(rate, t[[0, -1]], start, "LSODA", t, rtol=1e-10, atol=1e-12).y.T


CUT = [
    (PID, np.inf, [1e-3, 2e-4], 0.1, 1e-9, 1e-8),
    (PID, 0.8, [1e-2, 2e-3], 0.15, 1e-8, 1e-7),
    (PID | {"tracking_time": 0.05}, 0.8, [1e-2, 2e-3], 0.15, 1e-8, 1e-7),
    ({"kind": "pd", "kp": [1e5], "kd": [10.0]}, 1.5, [0.05, 0.0], 0.1, 1e-6, 2e-6),
]


@pytest.mark.slow
@pytest.mark.parametrize(("feedback", "limit", "start", "periods", "tol", "within"), CUT)
def test_an_elastic_arm_agrees_with_steps_over_the_corners_of_its_torque(feedback, limit, start, periods, tol, within):
    """Integral action and filters as well, whose states see what is not given; and a loop so stiff that an error of the polynomials through
    the stages becomes one of the torque as large as the limit."""
    cut = {} if limit == np.inf else {"control.saturation": {"torque": [limit]}}
    filters = FILTERS if feedback["kind"] == "pid" else []
    lin = loop_of({"control.feedback": feedback, "control.filters": filters, **cut})
    start = np.array([*start, 0.0, 0.0, 0.0, 0.0])
    run = fl.simulate(lin, periods, initial=start, tol=tol)
    assert limit == np.inf or 0.1 < np.mean(np.abs(run.torque) > limit - 1e-8) < 1.0
    known = step_by_step(lin, limit, run.t, np.append(start, np.zeros(lin.law.memory + 1)))
    np.testing.assert_allclose(known[:, :6], run.nonlinear, atol=within)
    np.testing.assert_allclose(known[:, 6:-1], run.controller, atol=10 * within)
    assert run.error < 1e-5


def test_a_drive_at_its_limit_winds_an_integral_up_unless_a_tracking_time_unwinds_it():
    """A rigid link swings back from 2 rad under a tenth of the torque it asks for: J q'' = clip(u), against SciPy's LSODA."""
    overshoot = []
    for share in (None, 0.2):
        changes = BLOCK | {"control.filters": [], "control.saturation": {"torque": [0.5]}}
        changes["control.feedback"] = PID | ({} if share is None else {"tracking_time": share})
        lin = loop_of(changes)
        inertia = lin.M(0.0)[0, 0]

        def rate(t, x, inertia=inertia, share=share):
            asked = -KP * x[0] - KD * x[1] - KI * x[2]
            given = np.clip(asked, -0.5, 0.5)
            return [x[1], given / inertia, x[0] + (0.0 if share is None else (asked - given) / (KI * share))]

        run = fl.simulate(lin, 1.5, initial=[2.0, 0.0], tol=1e-8)
        known = solve_ivp(rate, (0.0, run.t[-1]), [2.0, 0.0, 0.0], "LSODA", run.t, rtol=1e-11, atol=1e-12).y.T
        np.testing.assert_allclose(np.hstack([run.nonlinear, run.controller]), known, atol=1e-6)
        assert run.to_xarray()["controller"].dims == ("time", "memory")
        overshoot.append(-run.nonlinear[:, 0].min())
    assert overshoot[1] < 0.6 * overshoot[0]


SMALL = {"links.0.modes": 1, "control.filters": [{"kind": "low-pass", "cutoff": "60 Hz"}]}


@pytest.fixture(scope="module")
def small():
    return loop_of(SMALL)


@pytest.mark.slow
def test_sensitivities_see_gains_on_integrals_and_frequencies_of_filters():
    scene = fl.load_scene("single-link", CONTROLLED | SMALL)
    paths = ["control.feedback.ki.0", "control.filters.0.cutoff", "effects.payload.mass", "motion.frequency"]
    slopes = fl.sensitivity(scene, paths, tol=1e-9)["derivative"].values[:, 0].real
    for path, slope in zip(paths, slopes, strict=True):
        own = get_value(scene, path)
        ends = fl.sweep(scene, {path: [own * (1 - 1e-4), own * (1 + 1e-4)]}, tol=1e-10)["exponents"].values[:, 0].real
        assert slope == pytest.approx((ends[1] - ends[0]) / (2e-4 * own), rel=1e-4, abs=1e-7)


def test_a_loop_broken_where_the_torque_enters_holds_its_controller_too(small):
    opened, t = extend_system(linearize(small.arm, small.motion).periodic_system(), small.controller.rates), [0.3]
    found = opened.feedback(small.law.gain).A(np.array(t))
    np.testing.assert_allclose(found, small.periodic_system().A(np.array(t)), rtol=1e-12)


@pytest.mark.slow
def test_other_answers_take_the_whole_loop(small):
    assert np.all(fl.control.linear_range(small, tol=1e-3).amplitudes > 0)
    assert linearize_about(periodic_motion(small, tol=1e-6)).n == small.states == 7
    answer = respond(small, state_disturbance("push", "tip 1 N 20 ms", small), periods=1.0, tol=1e-6)
    assert answer.problem == ""
    assert answer.difference < 0.05
    shaken = state_disturbance("noise", "torque 0.05 N m 100 Hz", small)
    noise = answer_noise(small, shaken, small.periodic_system(), 1e-6)
    assert noise.states.shape[1] == 4
    assert np.all(noise.states[:, 0] > 0)


def test_what_does_not_fit_is_refused_by_its_key():
    for change, key in (
        ({"control.feedback": PID | {"ki": [1.0, 2.0]}}, "control.feedback.ki"),
        ({"control.feedback": PID | {"tracking_time": 0.1}}, "control.feedback.tracking_time"),
        ({"control.feedback": {"kind": "none"}, "control.filters": FILTERS}, "control.filters"),
        ({"control.filters": [{"kind": "notch", "frequency": 3.0, "gain": 1.0}]}, "control.filters.0"),
        ({"control.filters": [{"kind": "low-pass", "cutoff": "3 mm"}]}, "control.filters.0"),
        ({"control.filters": [{"kind": "low-pass", "cutoff": 3.0, "joints": [2]}]}, "control.filters.0.joints"),
    ):
        with pytest.raises(SceneError) as error:
            fl.load_scene("single-link", {"designs": [], **change})
        assert key in str(error.value)


def test_filters_in_front_of_a_motor_hold_volts():
    motor = {"gear_ratio": 50.0, "torque_constant": 0.02, "resistance": 1.0}
    assert set(loop_of({"effects.motor": motor}).law.controller.units) == {"rad/s", "rad s", "V"}


def test_a_filter_of_one_joint_leaves_the_others_alone():
    scene = fl.load_scene("de-luca-siciliano-1991", {"designs": []})
    one = [{"kind": "low-pass", "cutoff": 20.0, "order": 1, "joints": [2]}]
    changes = {"control.feedback": scene.control.feedback.model_dump(), "control.filters": one}
    lin = loop_of(changes, "de-luca-siciliano-1991")
    n, gain = lin.n, lin.law.gain(np.zeros(1))[0]
    np.testing.assert_array_equal(gain[0], np.append(closed("de-luca-siciliano-1991").law.gain(np.zeros(1))[0, 0], 0.0))
    np.testing.assert_array_equal(gain[1], np.eye(2 * n + 1)[-1])
    too_many = lin.control.model_copy(update={"filters": (lin.control.filters[0].model_copy(update={"joints": (3,)}),)})
    with pytest.raises(ArgumentError, match=r"filters\.0\.joints"):
        linearize(lin.arm, lin.motion, too_many)
