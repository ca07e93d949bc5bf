"""Tuning: problems whose optimum is known in closed form, a published plant, and an arm judged on scenarios drawn by the test."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import gain_search, make_family
from flexlin.analyses.gain_search import SMOOTHING_LEVELS, Problem, follow_levels, lay_scenarios, smooth_growth
from flexlin.analyses.spectra import Family
from flexlin.errors import ArgumentError, NotStable
from flexlin.periodic import Spectra


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


@pytest.mark.slow
def test_gains_of_either_sign_are_tuned():
    """s^2 + a s + b with a = g - 1, b = 1 + h, both free: the limits of g decide, sum of the roots = -a."""

    first, limits = {"g": -0.5, "h": -0.2}, {"g": (-1.0, 4.0), "h": (-5.0, 5.0)}
    found = fl.tune(lambda g, h: oscillator(g - 1.0, 1.0 + h), first, limits=limits, starts=1, steps=40)
    assert found.growth == pytest.approx(-1.5, abs=0.02)
    assert found.before == pytest.approx(0.75 + np.sqrt(max(0.75**2 - 0.8, 0.0)), abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_smoothed_growth_is_above_the_largest_and_its_slope_is_its_own(seed):
    """Against differences in a direction that splits a double exponent, where the largest real part has an infinite slope."""
    rng = np.random.default_rng(seed)
    block = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    base = block @ np.array([[-1, 1, 0, 0], [0, -1, 0, 0], [0, 0, -2, 3], [0, 0, -3, -2.0]]) @ block.T
    change = block @ rng.standard_normal((4, 4)) @ block.T
    for mu in (0.3, 0.01):

        def smooth(values, mu=mu):
            return smooth_growth(values[None] + 0j, np.array([0.7]), mu, 2.0)

        def phi(e, smooth=smooth):
            return smooth(np.linalg.eigvals(base + e * change))[0]

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


@pytest.mark.slow
def test_arm_decays_twice_as_fast_in_all_scenarios():
    scene = fl.load_scene("single-link", {"links.0.modes": 1})
    vary = {"effects.payload.mass": (0.0, 0.3), "motion.frequency": (0.3, 1.2)}
    found = fl.tune(scene, vary=vary, starts=1, steps=20)
    assert found.growth <= 2 * found.before < 0
    rng = np.random.default_rng(11)
    judged = fl.sweep(found.scene, {path: rng.uniform(*ends, 100) for path, ends in vary.items()})
    assert float(judged["exponents"].real.max()) <= found.growth + 0.02 * abs(found.growth)


def test_the_result_is_confirmed_to_the_wanted_error_and_one_scenario_counts_once(monkeypatch):
    """Without numbers that vary all scenarios are the same, and an exponent seemed to meet itself."""
    asked = []
    monkeypatch.setattr("flexlin.analyses.tuning.floquet", lambda loop, tol: asked.append(tol) or fl.floquet(loop, tol))
    found = fl.tune(lambda gain: oscillator(gain, 1.0), {"gain": 0.3}, None, {"gain": (0.1, 1.0)}, starts=1, tol=1e-5)
    assert asked == [1e-5]
    assert found.scenarios == 1
    assert found.limits[-1] == "one exponent at one scenario"


def test_what_cannot_be_tuned_is_refused():
    """As x' = x beside a mode that the gain moves."""
    with pytest.raises(NotStable, match=r"got unstable, expected gains that hold everywhere"):
        fl.tune(lambda k: fl.PeriodicSystem([[1.0, 0.0], [0.0, -k]], 1.0), {"k": 1.0}, starts=1)
    with pytest.raises(ArgumentError, match="first values"):
        fl.tune(oscillator, ["gain"])
    with pytest.raises(ArgumentError, match="do not rise"):
        fl.tune(oscillator, {"gain": 1.0}, limits={"gain": (2.0, 1.0)})
    with pytest.raises(ArgumentError, match="needs limits"):
        fl.tune(oscillator, {"gain": 0.0})


@pytest.mark.slow
@pytest.mark.parametrize("spectra", [1, 200])
def test_time_ends_the_search_with_the_best_gains_so_far(monkeypatch, spectra):
    """A clock that goes by one second a spectrum: after the first, or in the middle of the search."""
    made = []
    monkeypatch.setattr(gain_search.Stopwatch, "seconds", property(lambda _: float(len(made))))

    def loop(gain, stiffness):
        made.append(gain)
        return oscillator(gain, stiffness)

    found = fl.tune(loop, {"gain": 0.3}, {"stiffness": (1.0, 4.0)}, {"gain": (0.1, 10.0)}, seconds=spectra)
    assert "the time, which ended the search" in found.limits
    assert found.before == pytest.approx(-0.15)
    assert (found.growth == pytest.approx(-0.15)) == (spectra == 1)
    assert found.growth <= found.before
    assert found.growth == pytest.approx(max(np.linalg.eigvals([[0, 1], [-1, -found.gains["gain"]]]).real), abs=1e-6)


def test_large_arms_are_tuned_one_by_one_along_exact_slopes():
    """Batches of many states pay less than `floquet` alone, and differences take two spectra a gain."""
    assert not make_family(fl.load_scene("manutec-r3"), {"control.feedback.kp.0": (1e4, 3e4)}, "own").batched
    assert make_family(fl.load_scene("single-link"), {"control.feedback.kp.0": (1.0, 3.0)}, "own").batched
