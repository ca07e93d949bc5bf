"""Largest values of a simulation: those of the motion, however many output times there are."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.simulation import Drive
from flexlin.simulation.result import find_peaks, subdivide
from tests.closed_arm import closed


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


@pytest.mark.parametrize(
    "changes",
    [{"motion.frequency": 0.02}, pytest.param({"links.0.modes": 3, "motion.frequency": 0.1}, marks=pytest.mark.slow)],
)
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
