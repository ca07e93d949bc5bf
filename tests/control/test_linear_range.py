"""The range of the linear equations against a search at many times of a motion that another program integrates."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import flexlin as fl
from flexlin.control import linear_range
from flexlin.control.slow_motions import slow_motions
from flexlin.errors import NumericalError
from tests.closed_arm import both


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
