"""What a simulation says of its own errors, of its size and largest values, and of where an integrator only tried to go."""

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.control import linear_range, pd_feedback
from flexlin.control.validity import LARGEST_AMPLITUDE, SMALLEST_AMPLITUDE
from flexlin.errors import DesignError, NumericalError, SimulationStopped, TooLarge
from flexlin.simulation import Drive, simulate
from flexlin.simulation.equations import ModedEquations, NonlinearEquations
from flexlin.simulation.result import find_peaks, subdivide
from tests.closed_arm import closed, opened
from tests.mechanics.scenes import scene_of
from tests.mechanics.test_large_bending import THIN, light_arm
from tests.thinned import thin


@pytest.fixture(scope="module")
def lin():
    return closed()


def test_the_linear_answer_does_not_depend_on_the_output_grid():
    """Slow motion, few points: one step from point to point would cross the fast modes' transient blindly."""
    slow = closed(changes={"motion.frequency": 0.01})
    coarse, fine = (simulate(slow, 0.1, tol=1e-7, points_per_period=points) for points in (120, 1920))
    apart = np.abs(coarse.linear - fine.linear[::16]).max()
    assert apart <= coarse.linear_error + fine.linear_error + 1e-10
    assert coarse.linear_error <= 1e-7
    assert 0 < coarse.difference_error < 1e-5 < coarse.difference


def test_without_a_loop_both_answers_get_the_torque_of_the_rigid_motion():
    """The linear side used to go without the feedforward that moved the nonlinear one."""
    run = simulate(opened()[1], 0.05, tol=1e-9)
    assert np.abs(run.linear - run.nonlinear).max() < 0.25 * np.abs(run.nonlinear).max()


def test_metres_are_compared_with_metres(lin):
    """A joint far off in rad does not make a difference of tips in m look small, and the other way round."""
    run = simulate(lin, 0.05, tol=1e-6)
    aside = np.array([[0.01, 0.0]])
    tip = run.tip_rigid + aside
    tips = {"tip": tip, "tip_linear": tip + aside / 2, "peaks": None}
    made = replace(run, nonlinear=run.nonlinear + 50.0, difference_error=1e-9, **tips)
    assert "33 %" in made.status
    assert "beyond the linear model" in made.status
    missing = dict.fromkeys(tips, np.full_like(run.tip, np.nan)) | {"peaks": None}
    states, half = (np.tile([50.0, w, 0.0, 0.0, 0.0, 0.0], (len(run.t), 1)) for w in (1e-3, 5e-4))
    bare = replace(run, nonlinear=states, linear=half, error=1e-12, linear_error=0.0, **missing)
    assert "w11" in bare.status
    assert "50 %" in bare.status


def test_what_rounding_leaves_is_no_difference(lin):
    """All of a deviation of 1e-16 m was called beyond the linear model."""
    run = simulate(lin, 0.05, tol=1e-6)
    tiny = replace(run, tip=run.tip_rigid + 1e-16, tip_linear=run.tip_rigid, difference_error=0.0, peaks=None)
    assert "agree to rounding: the linear model holds" in tiny.status


def test_a_simulation_of_unreasonable_size_is_refused_before_it_begins(lin):
    for wrong in ({"periods": 1e9}, {"periods": 1e300}, {"points_per_period": 10**9}):
        with pytest.raises(TooLarge, match="fewer"):
            simulate(lin, **wrong)


@pytest.mark.slow
def test_a_motion_that_enlarges_every_error_judges_nothing():
    """A light arm bent far and let go: two runs ended 1.1 of the largest state apart, and the advice was to trust the simulation."""
    arm, rng = light_arm(216)
    w = np.r_[0.0, 0.0, rng.normal(size=arm.n - 2)]
    w *= 0.15 / np.abs(w).sum()
    run = simulate(fl.linearize(arm, scene_of(THIN, THIN).motion), 1.0, np.r_[w, 0 * w], tol=1e-6)
    assert run.is_unresolved
    assert "judges no linear model: simulate fewer periods" in run.status
    assert "trust" not in run.status


HELD = ModedEquations, Drive(sample_time=0.02)
TOUCHED = [(NonlinearEquations, Drive()), HELD, (ModedEquations, Drive(limit=(0.4,)))]


@pytest.mark.parametrize(("equations", "drive"), TOUCHED)
def test_a_window_that_leaves_the_range_only_shortens_the_steps(lin, monkeypatch, equations, drive):
    """The same where many steps are solved at once: some residuals ahead are no numbers."""
    expected = simulate(lin, 0.1, tol=1e-8, drive=drive).nonlinear
    real, refused = equations.places, []

    def touchy(self, t):
        at = real(self, t)
        if len(refused) < 20 and t[-1] > 0.013 * (1 + len(refused) // 4):
            refused.append(t[-1])
            at.offset[-1] = np.nan
        return at

    monkeypatch.setattr(equations, "places", touchy)
    found = simulate(lin, 0.1, tol=1e-8, drive=drive).nonlinear
    assert refused
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize(("equations", "drive"), TOUCHED[:2])
def test_the_last_time_reached_is_named_when_no_window_leads_on(lin, monkeypatch, equations, drive):
    real = equations.places

    def wall(self, t):
        at = real(self, t)
        at.offset[t > 0.05] = np.nan
        return at

    monkeypatch.setattr(equations, "places", wall)
    words = r"stopped at t = 0\.05 s.*no step is short enough.*its mass matrix is sound"
    with pytest.raises(NumericalError, match=words):
        simulate(lin, 0.1, drive=drive)


def test_a_mass_matrix_that_becomes_singular_is_read_from_the_state_that_was_reached():
    """A model of one's own whose kinetic energy is no square: M(s) = diag(1, 1 - (w / 0.1)^2), and gravity lets w fall."""
    s, rate = ca.SX.sym("s", 2), ca.SX.sym("rate", 2)
    T = (rate[0] ** 2 + (1 - (s[1] / 0.1) ** 2) * rate[1] ** 2) / 2
    arm = fl.Manipulator.from_lagrangian(s, rate, T, s[0] ** 2 - s[1], joints=[0], names=["q1", "w11"])
    weak = fl.linearize(arm, fl.load_scene("single-link").motion)
    with pytest.raises(SimulationStopped, match="mass matrix that becomes singular") as caught:
        simulate(weak, 1.0, tol=1e-6)
    end = caught.value
    M = weak.about.of_arm("M", np.array([end.t]), end.reached[None, : weak.n])[0]
    rigid = weak.about.of_arm("M", np.array([end.t]), np.zeros((1, weak.n)))[0]
    assert end.left_range
    assert 0 < np.linalg.eigvalsh(M)[0] < 1e-4 * np.linalg.eigvalsh(rigid)[0]
    assert f"{abs(end.reached[0]):.3g} rad in q1 and {np.abs(end.reached[1 : weak.n]).max():.3g} m in w11" in str(end)
    assert pickle.loads(pickle.dumps(end)).left_range


def test_a_design_without_weights_says_so(lin):
    made = pd_feedback(fl.linearize(lin.arm, lin.motion).periodic_system(), [0], [10.0], [1.0])
    with pytest.raises(DesignError, match=r"no weights.*problem="):
        made.cost(np.zeros(6))


@pytest.mark.parametrize("changes", [{"control.feedback.kp": [1e20]}, {"links.0.bending_stiffness": 5e12}])
def test_the_linear_range_of_a_loop_with_absurd_modes_ends(changes):
    """It asked for 163 GiB with the one and never ended with the other."""
    try:
        found = linear_range(closed(changes=changes))
    except (NumericalError, TooLarge):
        return
    assert "what it leaves out" in found.status
    assert SMALLEST_AMPLITUDE < found.amplitudes.min() <= LARGEST_AMPLITUDE


def spring(width):
    """One coordinate on a spring k s that gives way: g = k width tanh(s / width)."""
    s, rate = ca.SX.sym("s"), ca.SX.sym("rate")
    g = 4.0 * width * ca.tanh(s / width)
    arm = fl.Manipulator.from_matrices(s, rate, ca.SX(1.0), ca.SX(0.0), g, damping=0.1 * rate)
    motion = fl.load_scene("single-link", {"motion.joints": [{"amplitude": 0.0, "mean": 0.0}]}).motion
    return fl.linearize(arm, motion)


def test_the_linear_range_says_where_it_looked():
    """width (1 - tanh(x) / x) reaches a tenth at x = 0.58; below the smallest amplitude tried it must not name one."""
    assert linear_range(spring(1.0)).amplitudes.min() == pytest.approx(0.58, abs=0.06)
    nowhere = linear_range(spring(1e-9))
    assert nowhere.amplitudes.min() == 0.0
    assert "already at deflections of 1e-07" in nowhere.status
    assert "holds nowhere" in nowhere.status
    everywhere = linear_range(spring(1e6))
    assert np.isinf(everywhere.amplitudes).all()
    assert "up to 10 rad in s1, the largest tried" in everywhere.status


@pytest.mark.slow
def test_the_linear_range_does_not_depend_on_the_segments_of_the_exponents():
    """The linear terms of this loop all pass through small values within 0.01 s, where the share peaks."""
    lin = closed()
    system = lin.periodic_system()
    coarse, fine = (linear_range(lin, result=fl.floquet(system, segments=count)) for count in (150, 4000))
    assert coarse.amplitudes == pytest.approx(fine.amplitudes, rel=0.03)


def figures(run):
    return np.concatenate([[run.difference, run.tip_error, run.deviation], run.peak_torque])


def test_the_peak_of_a_parabola_is_found_between_uneven_times():
    t = np.array([0.0, 0.3, 0.5, 1.1, 1.2])
    found = find_peaks(t, np.column_stack([3 - (t - 0.62) ** 2, 2 - 5 * (t - 0.41) ** 2, t, np.full(5, np.nan), 0 * t]))
    np.testing.assert_allclose(found, [3.0, 2.0, 1.2, np.nan, 0.0], rtol=1e-14)


def test_a_jump_beside_a_top_lifts_no_peak_far():
    """What rises by 1 before the largest value lifts it by no more than that, however near the times are."""
    assert find_peaks(np.array([0.0, 1e-9, 1.0]), np.array([[0.0], [1.0], [0.999]]))[0] <= 2.0


def test_steps_are_divided_and_output_times_kept():
    t = np.linspace(0.0, 1.0, 4)
    often = subdivide(t, np.array([0.5, 1.0]), 10)
    np.testing.assert_allclose(np.setdiff1d(often, t), np.arange(1, 16) / 16)
    assert np.isin(t, often).all()
    assert subdivide(t, np.array([0.5, 1.0]), 2**25) is t


@pytest.mark.parametrize("changes", thin([{"motion.frequency": 0.02}, {"links.0.modes": 3, "motion.frequency": 0.1}]))
def test_peaks_do_not_depend_on_the_output_times(changes):
    """A link that rings at 2 to 15 Hz on a motion of 50 s: a few output times meet no peak of it."""
    lin = closed(changes=changes)
    few, many = (fl.simulate(lin, 0.5, points_per_period=points) for points in (16, 4096))
    np.testing.assert_allclose(figures(few), figures(many), rtol=1e-4)
    met = np.linalg.norm(few.tip - few.tip_linear, axis=1).max()
    assert met < 0.98 * few.difference
    assert np.abs(many.torque).max() <= many.peak_torque[0] * (1 + 1e-12)


@pytest.mark.slow
def test_peaks_of_a_torque_that_is_cut_or_held():
    """Through corners no parabola is laid: the limit is the peak."""
    lin = closed(changes={"links.0.modes": 1})
    cut = fl.simulate(lin, 0.25, tol=1e-6, points_per_period=8, drive=Drive(limit=(0.4,)))
    assert cut.peak_torque[0] == 0.4
    held = fl.simulate(lin, 0.25, tol=1e-6, points_per_period=8, drive=Drive(sample_time=0.01))
    finer = fl.simulate(lin, 0.25, tol=1e-6, points_per_period=512, drive=Drive(sample_time=0.01))
    np.testing.assert_allclose([held.tip_error, held.deviation], [finer.tip_error, finer.deviation], rtol=1e-3)
