"""How far a loop may go. The smallest change that makes it unstable: against brute force on random systems, and critical values of one
number. The range of the linear equations: against a search at many times of a motion that another program integrates."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

import flexlin as fl
from flexlin.analyses import make_box
from flexlin.control import linear_range
from flexlin.control.slow_motions import slow_motions
from flexlin.errors import ArgumentError, NotStable, NumericalError, SceneError
from flexlin.report import write_report
from tests.closed_arm import both

SMALL = {"links.0.modes": 1, "designs": []}
RANGES = {"effects.payload.mass": {"low": 0.0, "high": 0.2}, "motion.frequency": {"low": 0.3, "high": 0.9}}


def brute_force(A0, parts, directions):
    """The least largest change at which an eigenvalue of A0 + sum u_i A_i meets the imaginary axis: by bisection on many rays."""
    best, levels = np.inf, np.linspace(0, 4, 161)
    for A in np.tensordot(directions, parts, 1):

        def growth(level, A=A):
            return np.linalg.eigvals(A0 + np.multiply.outer(level, A)).real.max(axis=-1)

        k = int(np.argmax(growth(levels) > 0))
        best = min(best, brentq(growth, *levels[k - 1 : k + 1], xtol=1e-10) if k else np.inf)
    return best


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_systems_against_brute_force(seed):
    rng = np.random.default_rng([seed, 71])
    n, P = 4, int(rng.integers(1, 3))
    A0 = rng.standard_normal((n, n))
    A0 -= (np.linalg.eigvals(A0).real.max() + 0.4) * np.eye(n)
    parts = rng.standard_normal((P, n, n)) * 0.4
    angle = np.linspace(0, 2 * np.pi, 1600, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) if P == 2 else np.array([[1.0], [-1.0]])
    truth = brute_force(A0, parts, around / np.abs(around).max(axis=1, keepdims=True))

    def loop(*numbers):
        return fl.PeriodicSystem(A0 + np.tensordot(np.array(numbers) / 3.0, parts, 1), 1.0)

    found = fl.nearest_instability(loop, {f"p{i}": (-3.0, 3.0) for i in range(P)}, own=[0.0] * P)
    assert found.confirmed
    assert truth * (1 - 1e-2) <= found.scale <= truth * (1 + 1e-6)
    at = np.linalg.eigvals(loop(*found.values).A(np.zeros(1))[0]).real.max()
    assert abs(at) < 1e-8
    assert np.abs(found.values / 3.0).max() == pytest.approx(found.scale)
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * P), axis=-1).reshape(-1, P)
    every = np.linalg.eigvals(A0 + np.tensordot(grid, parts, 1)).real.max(axis=1)
    corners = every[np.abs(grid).min(axis=1) == 1]
    assert every.min() - 1e-3 <= found.growth[0] <= corners.min() + 1e-8
    assert corners.max() - 1e-8 <= found.growth[1] <= every.max() + 1e-3


def test_one_number_of_a_scene_against_its_critical_value():
    scene = fl.load_scene("single-link", SMALL)
    found = fl.nearest_instability(scene, {"effects.payload.mass": (0.0, 0.2)})
    (critical,) = fl.critical_values(scene, "effects.payload.mass", (0.01, 0.71), samples=65)
    assert found.values[0] == pytest.approx(critical.value, abs=1e-6)
    assert found.scale == pytest.approx((critical.value - 0.03) / 0.17, abs=1e-5)


def test_a_sweep_may_leave_the_table_of_a_scene():
    scene = fl.load_scene("single-link", {**SMALL, "uncertainty": RANGES})
    assert fl.sweep(scene, {"effects.payload.mass": [0.0, 0.4]}, tol=1e-4)["exponents"].notnull().all()


def test_tables_that_lead_nowhere_are_refused():
    for table, word in (
        ({"effects.payload.mas": {"low": 0.0, "high": 1.0}}, "expected one of mass"),
        ({"links.0.modes": {"low": 0.0, "high": 1.0}}, "no real number"),
        ({"motion.frequency": {"low": 0.9, "high": 0.3}}, "low below high"),
        ({"motion.frequency": 3.0}, "a table"),
        ({f"links.{i}.length": {"low": 0.0, "high": 1.0} for i in range(20)}, "12 at most"),
    ):
        with pytest.raises(SceneError, match="uncertainty") as refused:
            fl.load_scene("single-link", {"uncertainty": table})
        assert word in str(refused.value)


def test_loops_that_cannot_be_asked_are_refused():
    scene = fl.load_scene("single-link", SMALL)
    with pytest.raises(ArgumentError, match="no range is known"):
        fl.nearest_instability(scene)
    with pytest.raises(ArgumentError, match=r"motion\.frequency does not hold"):
        fl.nearest_instability(scene, {"motion.frequency": (0.6, 0.9)})
    with pytest.raises(NotStable):
        fl.nearest_instability(lambda d: fl.PeriodicSystem([[d]], 1.0), {"d": (0.0, 2.0)}, own=[1.0])
    blade, rate = fl.load_scene("rotating-blade", {"designs": []}), "motion.joints.0.rate"
    assert fl.nearest_instability(blade, {rate: (10.0, 60.0)}).scale == np.inf  # also where it turns the other way
    with pytest.raises(ArgumentError, match="no period at 0"):
        fl.critical_values(blade, rate, (-20.0, 20.0))


@pytest.mark.parametrize("ends", [(0.1, 0.3), (0.1, 0.2)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_growth_rate_rises_to_the_side_on_which_a_number_can_go(ends, sign):

    def loop(d):
        return fl.PeriodicSystem([[0.0, 1.0], [-1.0, -sign * d]], 1.0)

    box = make_box(loop, {"damping": tuple(sorted(sign * end for end in ends))}, own=[0.2 * sign])
    assert box.uphill().tolist() == [-sign]


OUTSIDE = ("accuracy.tol", "accuracy.seconds", "designs.0.weights.rates", "uncertainty.motion.frequency.low")


@pytest.mark.parametrize("path", OUTSIDE)
def test_numbers_of_no_loop_are_not_swept_and_a_report_refuses_them_before_any_work(path, tmp_path, monkeypatch):
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "uncertainty": RANGES})
    with pytest.raises(ArgumentError):
        fl.sweep(scene, {path: [1e-9, 1e-3]})
    monkeypatch.setattr("flexlin.analyses.analysis.analyse", lambda *_: pytest.fail("analysed"))
    if path.startswith("accuracy"):
        limits = {"low": 1e-12, "high": 1e-3 if path.endswith("tol") else 90.0}
        with pytest.raises(ArgumentError):
            write_report(fl.load_scene("pick-and-place", {"uncertainty": {path: limits}}), tmp_path)


@pytest.mark.slow
def test_a_report_says_what_the_uncertain_numbers_may_do(tmp_path):
    scene = fl.load_scene("single-link", {**SMALL, "accuracy.seconds": 600.0, "uncertainty": RANGES})
    analysis, files = write_report(scene, tmp_path)
    found = analysis.nearest
    assert found.confirmed
    page = files[0].read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert "with its uncertain numbers: no instability found within the stated ranges; unstable from" in page
    assert f"growth rates within the stated ranges from −{-found.growth[0]:.4g} to −{-found.growth[1]:.4g} 1/s" in page
    # on the ray to the place the loop is stable at every smaller change
    own, shares = np.array(found.own), np.linspace(0, 1 - 1e-6, 9)[:, None]
    values = own + shares * (found.values - own)
    data = fl.sweep(analysis.scene, dict(zip(found.paths, values.T, strict=True)), tol=1e-6, grid=False)
    assert (data["exponents"].real.max("mode") < 1e-6).all()


def largest_shares(lin: fl.Linearization, plant: fl.Linearization, start: np.ndarray, sizes: np.ndarray) -> list[float]:
    """Of amplitudes the largest |R| / (a tenth of the largest linear term), |f|^2 = f' M^-1 f, at many times."""
    n, system, t = lin.n, lin.periodic_system(), np.linspace(0, lin.period, 40_001)
    A = CubicSpline(t[::10], system.A(t[::10]))
    exactly = {"t_eval": t, "rtol": 1e-10, "atol": 1e-12, "max_step": 0.01}
    x, M = solve_ivp(lambda s, x: A(s) @ x, (0, lin.period), start, "DOP853", **exactly).y.T, plant.M(t)

    def size(f: np.ndarray) -> np.ndarray:
        return np.sqrt(np.einsum("ti,ti->t", f, np.linalg.solve(M, f[:, :, None])[:, :, 0]))

    y, rate, after = x[:, :n], x[:, n:], np.einsum("tij,tj->ti", A(t), x)[:, n:]
    parts = [np.einsum("tij,tj->ti", c, z) for c, z in ((M, after), (plant.D(t), rate), (plant.K(t), y))]
    allowed, linear = np.max([size(part) for part in parts], axis=0), sum(parts)
    function = plant.arm.functions["residual"].map(len(t))
    q = [part @ np.array(ca.DM(plant.arm.reference)).T for part in plant.motion.sample(t)]

    def force(a: float) -> np.ndarray:
        moved = [(at + a * z).T for at, z in zip(q, (y, rate, after), strict=True)]
        return np.array(function(*moved, np.zeros((0, len(t))))).T

    return [(size(force(a) - force(0.0) - a * linear) / (0.1 * a * allowed)).max() for a in sizes]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["single-link", "de-luca-siciliano-1991"])
def test_no_peak_between_the_samples_is_missed(name: str) -> None:
    """The share of the second arm peaks within a thousandth of the period: 1,024 samples see 0.0612 where it is 0.0610."""
    _, plant, lin = both(name, {})
    found = linear_range(lin, tol=1e-6, plant=plant)
    for direction, amplitude, error in zip(found.directions, found.amplitudes, found.errors, strict=True):
        assert error < 2e-3 * amplitude
        beside = 3 * error + 1e-6 * amplitude
        below, above = largest_shares(lin, plant, direction, amplitude + np.array([-beside, beside]))
        assert below < 1 < above


def test_modes_that_die_out_within_the_period_are_named_as_the_reason():
    system = fl.PeriodicSystem.from_second_order([[1.0]], [[4.0]], [[3.0]], 1e9)
    with pytest.raises(NumericalError, match=r"dies out between two samples.*slowest at -1 1/s.*shorter period"):
        slow_motions(system, 1)


def test_a_mode_that_grows_beyond_all_numbers_within_the_period_is_a_motion():
    """exp(800) of y'' = y: the sizes of a motion are free, so it ends at its largest."""
    motion = slow_motions(fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], [[-1.0]], 800.0), 1)
    after = motion.t > 750.0
    np.testing.assert_allclose(motion.states[0][after, 0], np.exp(motion.t[after] - 800.0), rtol=1e-6)
    assert np.isfinite(motion.states).all()
