"""Values that are computed together, beside `floquet`; what is sent to workers, and shared among threads; how many segments each value is
computed on: pilots of a made-up kernel whose errors are known."""

import pickle
import time

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Found, Together, choose_crew, choose_loop, prepare_job, share_among_threads
from flexlin.analyses.sweep.found import MISSING
from flexlin.analyses.sweep.together import MOST_SEGMENTS, PILOT_VALUES, SEGMENT_NUMBERS, learn_needs
from flexlin.periodic import measure_distances
from flexlin.periodic.many import WIDTH, Logs
from tests.control.test_c_controllers import FILTERS, PID
from tests.sweep.test_sweep import MOVES
from tests.thinned import thin

NUMBERS = {"state_weight": [100.0, 100.0, 1.0, 1.0], "input_weight": [0.1]}
SIZES = {"weights": {"joints": "1 deg", "rates": "5 deg/s", "integrals": "0.2 deg s", "input": "0.5 N m"}}
LQR, LQI = ({"name": name, "kind": "frozen-lqr", "phases": 5, **w} for name, w in (("LQR", NUMBERS), ("LQI", SIZES)))
FILTERED = {"control.feedback": PID, "control.filters": FILTERS}
SINGLE = {"links.0.modes": 1, "designs": [LQR]}
TWO_LINKS = {"links.0.modes": 1, "links.1.modes": 1, "designs": []}
MASS, FREQUENCY = {"effects.payload.mass": (0, 0.3)}, {"motion.frequency": (0.3, 2)}
GAINS = {"control.feedback.kp.0": (0.5, 20.0), "control.feedback.kd.0": (0.02, 1.0)}
STATES = {"control.filters.1.frequency": (2, 9), "control.feedback.ki.0": (0.1, 20)}
CASES = {
    "random": (SINGLE, "own", MASS | GAINS | FREQUENCY | {"motion.joints.0.amplitude": (0.1, 1.5)}),
    "amplitude": (SINGLE, "open", {"motion.joints.0.amplitude": (0.1, 3)}),
    "breaks": (SINGLE | {"motion": MOVES}, "own", MASS),
    "kept gain": (SINGLE, "LQR", FREQUENCY),
    "states of the controller": (SINGLE | FILTERED, "own", STATES | FREQUENCY),
    "kept gain with integrals": (SINGLE | {"designs": [LQI]}, "LQI", FREQUENCY | MASS),
    "two links": (TWO_LINKS, "own", MASS | {"motion.frequency": (0.1, 0.5)}),
    "undamped": ({}, "own", {"motion.joints.0.rate": (1.5, 4.5)}),
}
SCENES = {"two links": "de-luca-siciliano-1991", "undamped": "spinning-link"}


@pytest.mark.parametrize("name", thin(list(CASES)))
def test_the_kernel_agrees_with_floquet_within_its_errors(name):
    changes, word, limits = CASES[name]
    rng = np.random.default_rng(5)
    loop = choose_loop(fl.load_scene(SCENES.get(name, "single-link"), changes), limits, word)
    points = np.stack([rng.uniform(low, high, 37) for low, high in limits.values()], axis=1)
    found = Together.prepare(loop, points, 1e-8).compute(points)
    assert not found.one_by_one.any()
    assert np.all(found.error <= 1e-8 * np.maximum(1.0, np.abs(found.exponents).max(axis=1)))
    for i in (0, 17, 36):
        exact = fl.floquet(loop.system_at(points[i]), 1e-11)
        apart = measure_distances(found.exponents[i] * exact.period, exact.log_multipliers) / exact.period
        assert np.all(apart.min(axis=1) <= found.error[i] + exact.error)
        assert np.all(apart.min(axis=0) <= found.error[i] + exact.error)


def test_results_do_not_depend_on_the_blocks_nor_on_pickling():
    loop = choose_loop(fl.load_scene("single-link", SINGLE), ["effects.payload.mass"])
    points = np.linspace(0.0, 0.3, 61)[:, None]
    work = Together.prepare(loop, points, 1e-8)
    again = pickle.loads(pickle.dumps(work))
    whole, parts = work.compute(points), [again.compute(points[i : i + 16]) for i in range(0, 61, 16)]
    assert np.array_equal(whole.exponents, np.concatenate([part.exponents for part in parts]))
    assert np.array_equal(whole.error, np.concatenate([part.error for part in parts]))


def job_of(count):
    values = {"effects.payload.mass": np.linspace(0.0, 0.3, count)}
    return prepare_job(fl.load_scene("single-link", SINGLE), values, 1e-8, False, "own")


def test_threads_share_values_and_pass_errors_on(monkeypatch):
    """Two threads, one: the same bits. A block that raises ends the sweep with its error."""
    monkeypatch.setattr("flexlin.analyses.sweep.together.BLOCK_VALUES", 8 * 16)
    job = job_of(61)
    assert len(job.blocks) == 8
    assert choose_crew(job).func is share_among_threads
    job.run(choose_crew(job, workers=1))
    alone = job.found.exponents.copy()
    job.found.verdict[:], job.found.exponents[:] = MISSING, np.nan
    job.run(choose_crew(job, workers=2))
    assert job.done.all()
    assert np.array_equal(job.found.exponents, alone)
    job.found.verdict[:], job.points[40] = MISSING, np.nan
    monkeypatch.setattr(Together, "compute", lambda self, points: 1 / int(np.isfinite(points).all()))
    with pytest.raises(ZeroDivisionError):
        list(share_among_threads(job, 2))


def test_threads_whose_blocks_nobody_waits_for_end_at_their_next_value(monkeypatch):
    """Values that go to `floquet` one by one take long: an interrupted sweep does not wait for all of a block."""
    job = job_of(800)
    assert job.work.block >= 90
    tried = []

    def slow(self, i, make, tol):
        tried.append(i)
        time.sleep(0.02)
        if i == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(Together, "solve", lambda self, points, enter: range(len(points)))
    monkeypatch.setattr(Found, "put_alone", slow)
    with pytest.raises(KeyboardInterrupt):
        list(share_among_threads(job, 2))
    assert len(tried) < 20


TOL, PERIOD = 1e-8, 3.0
"""Errors may be as large as tol times the period, which is longer than the logs are large."""


class MadeUp:
    """Errors of order 8, just met on `need(points)` segments; work counted in vectors times segments. Values without a need never meet."""

    def __init__(self, need):
        self.need, self.work = need, 0

    def find_logs(self, points, segments, scale, accuracy, spread, tol, levels):
        self.work += segments * -(-len(points) // WIDTH)
        errors = PERIOD * TOL * (self.need(points) / segments) ** 8
        logs = np.stack([np.full(len(points), -1.0 + 2j), np.full(len(points), -1.0 - 2j)], axis=1)
        periods, definite = np.full(len(points), PERIOD), np.full(len(points), True)
        return Logs(logs, np.stack([errors, errors / 3], axis=1), np.isfinite(errors), periods, definite)


def test_needs_are_learnt_from_values_all_over_the_plane():
    """Need by a power of a frequency over decades and an exponential of a second number."""
    rng = np.random.default_rng(3)
    points = np.stack([np.exp(rng.uniform(-3, 2, 5000)), rng.uniform(-1, 4, 5000)], axis=1)

    need = lambda p: 30.0 * p[:, 0] ** -0.4 * np.exp(0.1 * p[:, 1])  # noqa: E731
    kernel = MadeUp(need)
    needs = learn_needs(kernel, points, np.ones(2), TOL)
    found = needs.predict(points)
    off = SEGMENT_NUMBERS[found] / need(points)
    assert np.mean(off < 1) < 0.05
    assert np.mean(off) < 1.6
    assert kernel.work <= 9 * need(points).max() * PILOT_VALUES[1] / WIDTH
    assert np.array_equal(needs.predict(points[::-1]), found[::-1])


def test_values_without_a_need_do_not_cost_the_others():
    """Half of the plane never meets tol: given up soon, and the other half is as well known."""

    points = np.random.default_rng(1).uniform(-1, 1, (400, 1))
    kernel = MadeUp(lambda p: np.where(p[:, 0] > 0, 20.0, np.inf))
    needs = learn_needs(kernel, points, np.ones(2), TOL)
    assert np.all(SEGMENT_NUMBERS[needs.predict(points)] <= 23)
    assert needs.spread == 0.0
    assert kernel.work < 40 * 20 * PILOT_VALUES[0] / WIDTH
    nothing = learn_needs(MadeUp(lambda p: np.full(len(p), np.inf)), points, np.ones(2), TOL)
    assert np.all(SEGMENT_NUMBERS[nothing.predict(points)] == MOST_SEGMENTS)
