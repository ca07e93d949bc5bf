"""The smallest change that makes a loop unstable: against brute force on random systems, and against critical values of one number."""

import numpy as np
import pytest
from scipy.optimize import brentq

import flexlin as fl
from flexlin.analyses import make_box
from flexlin.report import write_report
from tests.public_results import oscillator

SMALL = {"links.0.modes": 1, "designs": []}
PATIENT = {"accuracy.seconds": 600.0}
RANGES = {"effects.payload.mass": {"low": 0.0, "high": 0.2}, "motion.frequency": {"low": 0.3, "high": 0.9}}


def brute_force(grow, directions):
    """The least largest change u at which an eigenvalue meets the imaginary axis: by bisection on many rays."""
    best, levels = np.inf, np.linspace(0, 4, 161)
    for ray in directions:
        unstable = np.flatnonzero(grow(np.multiply.outer(levels, ray)) > 0)
        if len(unstable):
            k = unstable[0]
            best = min(best, brentq(lambda level, ray=ray: grow(level * ray), levels[k - 1], levels[k]))
    return best


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_systems_against_brute_force(seed):
    rng, n = np.random.default_rng([seed, 71]), 4
    P, A0 = int(rng.integers(1, 3)), rng.standard_normal((n, n))
    A0 -= (np.linalg.eigvals(A0).real.max() + 0.4) * np.eye(n)
    parts = rng.standard_normal((P, n, n)) * 0.4

    def grow(u):
        return np.linalg.eigvals(A0 + np.tensordot(u, parts, 1)).real.max(axis=-1)

    angle = np.linspace(0, 2 * np.pi, 1600, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) if P == 2 else np.array([[1.0], [-1.0]])
    truth = brute_force(grow, around / np.abs(around).max(axis=1, keepdims=True))

    def loop(*numbers):
        return fl.PeriodicSystem(A0 + np.tensordot(np.array(numbers) / 3.0, parts, 1), 1.0)

    found = fl.nearest_instability(loop, {f"p{i}": (-3.0, 3.0) for i in range(P)}, own=[0.0] * P)
    assert found.confirmed
    assert truth * (1 - 1e-2) <= found.scale <= truth * (1 + 1e-6)
    assert abs(grow(found.values / 3.0)) < 1e-8
    assert np.abs(found.values / 3.0).max() == pytest.approx(found.scale)
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * P), axis=-1).reshape(-1, P)
    every = grow(grid)
    corners = every[np.abs(grid).min(axis=1) == 1]
    assert every.min() - 1e-3 <= found.growth[0] <= corners.min() + 1e-8
    assert corners.max() - 1e-8 <= found.growth[1] <= every.max() + 1e-3


def test_one_number_of_a_scene_against_its_critical_value():
    scene = fl.load_scene("single-link", SMALL)
    found = fl.nearest_instability(scene, {"effects.payload.mass": (0.0, 0.2)})
    (critical,) = fl.critical_values(scene, "effects.payload.mass", (0.01, 0.71), samples=65)
    assert found.values[0] == pytest.approx(critical.value, abs=1e-6)
    assert found.scale == pytest.approx((critical.value - 0.03) / 0.17, abs=1e-5)


def test_the_table_of_a_scene_is_read_and_a_sweep_may_leave_it():
    scene = fl.load_scene("single-link", {**SMALL, "uncertainty": RANGES})
    assert scene.uncertainty["motion.frequency"].high == 0.9
    assert fl.sweep(scene, {"effects.payload.mass": [0.0, 0.4]}, tol=1e-4)["exponents"].notnull().all()


def test_too_many_uncertain_numbers_are_refused():
    table = {f"links.{i}.length": {"low": 0.0, "high": 1.0} for i in range(20)}
    with pytest.raises(fl.errors.SceneError, match=r"uncertainty.*12 at most"):
        fl.load_scene("single-link", {"uncertainty": table})


def test_loops_that_cannot_be_asked_are_refused():
    scene = fl.load_scene("single-link", SMALL)
    with pytest.raises(fl.errors.ArgumentError, match="no range is known"):
        fl.nearest_instability(scene)
    with pytest.raises(fl.errors.ArgumentError, match=r"motion\.frequency does not hold"):
        fl.nearest_instability(scene, {"motion.frequency": (0.6, 0.9)})
    with pytest.raises(fl.errors.NotStable):
        fl.nearest_instability(lambda d: fl.PeriodicSystem([[d]], 1.0), {"d": (0.0, 2.0)}, own=[1.0])


@pytest.mark.parametrize("ends", [(0.1, 0.3), (0.1, 0.2)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_growth_rate_rises_to_the_side_on_which_a_number_can_go(ends, sign):
    limits = tuple(sorted(sign * end for end in ends))
    box = make_box(lambda d: oscillator(sign * d), {"damping": limits}, own=[0.2 * sign])
    assert box.uphill().tolist() == [-sign]
    for u in (np.array([-0.5]), np.array([0.5])):
        difference = (box.growth(u + 1e-4) - box.growth(u - 1e-4)) / 2e-4
        assert box.slope(u)[0] == pytest.approx(difference, abs=1e-6)


@pytest.mark.parametrize(
    "path", ["accuracy.tol", "accuracy.seconds", "designs.0.weights.rates", "uncertainty.motion.frequency.low"]
)
def test_numbers_of_no_loop_are_not_swept_and_a_report_refuses_them_before_any_work(path, tmp_path, monkeypatch):
    with pytest.raises(fl.errors.ArgumentError):
        fl.sweep(fl.load_scene("single-link", {"links.0.modes": 1, "uncertainty": RANGES}), {path: [1e-9, 1e-3]})
    monkeypatch.setattr("flexlin.analyses.analysis.analyse", lambda *_: pytest.fail("analysed"))
    if path.startswith("accuracy"):
        table = {path: {"low": 1e-12, "high": 1e-3 if path.endswith("tol") else 90.0}}
        with pytest.raises(fl.errors.ArgumentError):
            write_report(fl.load_scene("pick-and-place", {"uncertainty": table}), tmp_path)


@pytest.mark.slow
def test_a_report_says_what_the_uncertain_numbers_may_do(tmp_path):
    analysis, files = write_report(fl.load_scene("single-link", {**SMALL, **PATIENT, "uncertainty": RANGES}), tmp_path)
    found = analysis.nearest
    assert found is not None
    assert found.confirmed
    page = files[0].read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert "with its uncertain numbers: no instability found within the stated ranges; unstable from" in page
    assert f"growth rates within the stated ranges from {found.growth[0]:.4g} to {found.growth[1]:.4g} 1/s" in page
    # on the ray to the place the loop is stable at every smaller change
    steps, own = np.linspace(0, 1 - 1e-6, 9)[:, None], np.array(found.own)
    values = own + steps * (found.values - own)
    data = fl.sweep(analysis.scene, dict(zip(found.paths, values.T, strict=True)), tol=1e-6, grid=False)
    assert (data["exponents"].real.max("mode") < 1e-6).all()
