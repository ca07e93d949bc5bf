"""Tuning: problems whose optimum is known in closed form, and a published plant. Derivatives of exponents: against Richardson's differences
of scenes built anew and a closed form."""

import numpy as np
import pytest

import flexlin as fl
from flexlin import sensitivity
from flexlin.analyses import choose_paths, make_family
from flexlin.analyses.gain_search import SMOOTHING_LEVELS, Problem, follow_levels, lay_scenarios, smooth_growth
from flexlin.analyses.spectra import Family
from flexlin.errors import ArgumentError, NotStable
from flexlin.periodic import Spectra
from flexlin.scene import get_value, replace_value
from tests.closed_arm import control_loop


def two_masses(k):
    """Plant 1 / (s^2 (s^2 + 2)) with a controller of order two, y = C x, all nine of its numbers free: the closed loop."""
    A = np.diag([1.0, 1.0, 1.0], 1)
    A[3, 2] = -2.0
    B, C = np.array([[0.0], [0.0], [0.0], [1.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    Ac, Bc, Cc, Dc = k[:4].reshape(2, 2), k[4:6, None], k[None, 6:8], k[8]
    return np.block([[A + B * Dc @ C, B @ Cc], [Bc @ C, Ac]])


class MatrixLoops(Family):
    """The same loop as a family without Floquet's machinery: eigenvalues alone."""

    def rough(self, points):
        values = np.linalg.eigvals([two_masses(point) for point in points]) + 0j
        return Spectra(values, np.zeros(values.shape))

    def periods(self, points):
        return np.ones(len(points))

    def slopes(self, point):
        """d lambda = w^H dA v / w^H v."""
        values, right = np.linalg.eig(two_masses(point))
        changes = np.array([two_masses(point + step) - two_masses(point) for step in np.eye(9)])  # A is affine
        return values + 0j, np.zeros(6), np.einsum("kij,ni,jn->kn", changes, np.linalg.inv(right), right)


@pytest.mark.slow
def test_two_masses_and_a_spring_come_to_their_optimum(monkeypatch):
    """The least abscissa that is known is -sqrt(15)/5, six eigenvalues in one point. Source: Burke, Henrion, Lewis, Overton (2006).

    From such starts SciPy's BFGS, without smoothing, ends at -0.231 at best, and at +0.016 in the median.
    """
    monkeypatch.setattr(Problem, "exact", True)
    for start in np.random.default_rng(1).standard_normal((2, 9)):
        problem = Problem(MatrixLoops(None, None), np.full(9, -20.0), np.full(9, 20.0), np.zeros((1, 0)))
        growth, x = follow_levels(problem, problem.position(start), 300, SMOOTHING_LEVELS)
        assert growth == np.linalg.eigvals(two_masses(problem.gains(x))).real.max()
        assert growth <= -np.sqrt(15) / 5 + 5e-3


@pytest.mark.parametrize("seed", range(4))
def test_smoothed_growth_is_above_the_largest_and_its_slope_is_its_own(seed):
    """Against differences in a direction that splits a double exponent, where the largest real part has an infinite slope."""
    rng = np.random.default_rng(seed)
    block = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    base = block @ np.array([[-1, 1, 0, 0], [0, -1, 0, 0], [0, 0, -2, 3], [0, 0, -3, -2.0]]) @ block.T
    change = block @ rng.standard_normal((4, 4)) @ block.T
    for mu in (0.3, 0.01):
        smooth = lambda values, mu=mu: smooth_growth(values[None] + 0j, np.array([0.7]), mu, 2.0)  # noqa: E731
        phi = lambda e, smooth=smooth: smooth(np.linalg.eigvals(base + e * change))[0]  # noqa: E731
        assert phi(0.0) > -1.0
        e, h = 0.02 * mu, 1e-6 * mu
        values, right = np.linalg.eig(base + e * change)
        slopes, weights = np.diag(np.linalg.inv(right) @ change @ right), smooth(values)[1][0]
        assert weights.sum().real == pytest.approx(1.0, abs=1e-9)
        assert (weights @ slopes).real == pytest.approx((phi(e + h) - phi(e - h)) / (2 * h), rel=1e-3, abs=1e-3)
        # on either side of the double exponent the slope is the same: the function is smooth there
        h = 1e-5 * mu
        sides = (phi(h) - phi(0.0)) / h, (phi(0.0) - phi(-h)) / h
        assert sides[0] == pytest.approx(sides[1], rel=1e-2, abs=1e-2 / mu)


def oscillator(gain, stiffness):
    return fl.PeriodicSystem([[0.0, 1.0], [-stiffness, -gain]], 1.0)


@pytest.mark.slow
def test_worst_stiffness_decides_and_a_limit_that_binds_is_named():
    """s^2 + g s + k, 1 <= k <= 4: the decay is greatest where the softest one is critically damped, g = 2."""
    found = fl.tune(oscillator, {"gain": 0.5}, {"stiffness": (1.0, 4.0)}, {"gain": (0.1, 10.0)}, starts=1, steps=40)
    assert found.growth == pytest.approx(-1.0, abs=2e-3)
    assert found.before == pytest.approx(-0.25, abs=1e-6)
    assert found.gains["gain"] == pytest.approx(2.0, rel=5e-3)
    # all pairs decay by g/2 there
    assert all(one.exponent.real == pytest.approx(-1.0, abs=2e-2) for one in found.active)
    bound = fl.tune(oscillator, {"gain": 0.5}, {"stiffness": (1.0, 4.0)}, {"gain": (0.1, 1.0)}, starts=1)
    assert bound.gains["gain"] == pytest.approx(1.0, rel=2e-3)
    assert any("gain at its limit of 1" in text for text in bound.limits)


def test_slope_of_an_arm_by_floquet_vectors_and_by_differences(monkeypatch):
    scene = fl.load_scene("single-link", {"links.0.modes": 1})
    vary = {"effects.payload.mass": (0.0, 0.3)}
    gains = {"control.feedback.kp.0": (0.3, 30.0), "control.feedback.kd.0": (0.05, 5.0)}
    family = make_family(scene, {**gains, **vary}, "own")
    problem = Problem(family, np.array([0.3, 0.05]), np.array([30.0, 5.0]), lay_scenarios(np.array([[0.0, 0.3]]), 3))
    x = problem.position(np.array([3.0, 0.5]))
    value, slope = problem.judge(x, 0.05, 2.0, 1e-4)
    monkeypatch.setattr(Problem, "exact", True)
    again, exact = problem.judge(x, 0.05, 2.0, 1e-4)
    assert again == pytest.approx(value, abs=1e-7)
    np.testing.assert_allclose(slope, exact, rtol=1e-4)


def test_the_result_is_confirmed_to_the_wanted_error_and_one_scenario_counts_once(monkeypatch):
    """Without numbers that vary all scenarios are the same, and an exponent seemed to meet itself."""
    asked = []
    monkeypatch.setattr("flexlin.analyses.tuning.floquet", lambda loop, tol: asked.append(tol) or fl.floquet(loop, tol))
    found = fl.tune(lambda gain: oscillator(gain, 1.0), {"gain": 0.3}, None, {"gain": (0.1, 1.0)}, starts=1, tol=1e-5)
    assert (asked, found.scenarios, found.limits[-1]) == ([1e-5], 1, "one exponent at one scenario")


def test_what_cannot_be_tuned_is_refused():
    """As x' = x beside a mode that the gain moves."""
    with pytest.raises(NotStable, match=r"got unstable, expected gains that hold everywhere"):
        fl.tune(lambda k: fl.PeriodicSystem([[1.0, 0.0], [0.0, -k]], 1.0), {"k": 1.0}, starts=1)
    limits = {"gain": (2.0, 1.0)}, {"torque": 2.0}, {}
    said = "do not rise", "limits are of what is tuned; got torque, expected some of gain", "needs limits"
    for gains, limit, match in (["gain"], {}, "first values"), *zip([{"gain": 0.0}] * 3, limits, said, strict=True):
        with pytest.raises(ArgumentError, match=match):
            fl.tune(oscillator, gains, limits=limit)


@pytest.mark.slow
@pytest.mark.parametrize("spectra", [1, 200])
def test_time_ends_the_search_with_the_best_gains_so_far(monkeypatch, spectra):
    """A clock that goes by one second a spectrum: after the first, or in the middle of the search."""
    made = []
    monkeypatch.setattr("flexlin.resources.Stopwatch.seconds", property(lambda _: float(len(made))))

    def loop(gain, stiffness):
        made.append(gain)
        return oscillator(gain, stiffness)

    found = fl.tune(loop, {"gain": 0.3}, {"stiffness": (1.0, 4.0)}, {"gain": (0.1, 10.0)}, seconds=spectra)
    assert "the time, which ended the search" in found.limits
    assert found.growth <= found.before == pytest.approx(-0.15)
    assert (found.growth == pytest.approx(-0.15)) == (spectra == 1)
    assert found.growth == pytest.approx(max(np.linalg.eigvals([[0, 1], [-1, -found.gains["gain"]]]).real), abs=1e-6)


@pytest.mark.slow
def test_each_joint_keeps_its_own_limit_of_torque():
    """Joint 1 takes 0.26 N m, joint 2 0.09; on the way to the fastest decay of the single link its torque comes to the limit."""
    wide = fl.load_scene("de-luca-siciliano-1991", {"control.saturation.torque": [20.0, 0.15]})
    few = {"steps": 3, "starts": 1}
    assert fl.tune(wide, ["control.feedback.kd.1"], **few).limits == ("one exponent at one scenario",)
    assert "exceeds" in fl.tune(wide, ["control.feedback.kd.1"], None, {"torque": 0.15}, **few).limits[0]
    control = {"feedforward": "none", "feedback": {"kind": "pd", "kp": [1.5], "kd": [3.0]}}
    found = fl.tune(fl.load_scene("single-link", {"control": control}), None, None, {"torque": 1.1}, starts=1, steps=20)
    assert found.limits[0] == "a joint's torque in the steady motion is at its limit"
    lin = fl.linearize(fl.build_manipulator(found.scene), found.scene.motion, found.scene.control)
    last = fl.simulate(lin, 6, tol=1e-5).linear[-129:, [0, lin.n]]
    assert 1.08 < np.abs(last @ list(found.gains.values())).max() < 1.1001


@pytest.fixture(scope="module")
def scene():
    overrides = {"links.0.modes": 1, "designs": [], "effects.hub.inertia": 0.01, "control.feedback.kd.0": 0.1}
    return fl.load_scene("single-link", overrides)


PATHS = (
    *("effects.payload.mass", "links.0.bending_stiffness", "links.0.length", "motion.frequency"),
    *("motion.joints.0.amplitude", "control.feedback.kp.0", "control.feedback.kd.0"),
)


def exponents(scene):
    return fl.floquet(control_loop(scene).periodic_system(), 1e-12).exponents


def richardson(scene, path):
    """d exponents / d parameter by central differences of two steps, extrapolated to order 4."""
    value, centre = get_value(scene, path), exponents(scene)

    def slope(step):
        ends = (exponents(replace_value(scene, path, value + sign * step)) for sign in (1, -1))
        plus, minus = (end[np.abs(centre[:, None] - end).argmin(axis=1)] for end in ends)
        return (plus - minus) / (2 * step)

    return (4 * slope(1e-3 * value) - slope(2e-3 * value)) / 3


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS)
def test_against_differences_of_scenes_built_anew(scene, path):
    """Also what one percent more of the number does to the growth rates."""
    result = sensitivity(scene, [path])
    exact = richardson(scene, path)
    assert np.abs(result.derivative.values[0] - exact).max() <= 1e-6 * np.abs(exact).max()
    change = exact.real * get_value(scene, path) / 100
    assert np.abs(result.percent.values[0] - change).max() <= 1e-6 * np.abs(change).max() + 1e-9


def test_a_spinning_link_without_gravity_in_closed_form():
    """x'' + 2 zeta w x' + (w^2 - W^2) x = 0 has the exponents -zeta w +- i sqrt(w^2 - W^2 - zeta^2 w^2), w^2 proportional to EI."""
    motion = {"kind": "rotation", "drive": "prescribed", "joints": [{"rate": 3.0}]}
    bare = {"links.0.modes": 1, "designs": [], "control": {}, "effects": {"modal_damping": {"ratio": 0.02}}}
    scene = fl.load_scene("single-link", {**bare, "motion": motion})
    link = scene.links[0]
    square = 1.87510407**4 * link.bending_stiffness / link.mass_per_length / link.length**4
    paths = ["effects.modal_damping.ratio", "links.0.bending_stiffness"]
    by_ratio, by_stiffness = sensitivity(scene, paths).derivative.values
    assert np.allclose(by_ratio.real, -np.sqrt(square), rtol=1e-7)
    imaginary = np.sqrt(square - 3.0**2 - 0.02**2 * square)
    expected = square * (1 - 0.02**2) / link.bending_stiffness / (2 * imaginary)
    assert np.allclose(np.abs(by_stiffness.imag), expected, rtol=1e-6)


def test_every_number_of_the_scene_by_default(scene):
    result = sensitivity(scene)
    assert set(result.parameter.values) == set(choose_paths(scene))
    assert "effects.gravity.acceleration" in result.parameter.values
    assert np.isfinite(result.derivative.values).all()
