"""Values that are computed together, beside `floquet`; what is sent to workers, and shared among threads."""

import pickle
import time

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Found, Together, choose_crew, choose_loop, make_family, prepare_job, share_among_threads
from flexlin.analyses.sweep.found import MISSING
from flexlin.periodic import Kernel, measure_distances
from tests.thinned import thin

NUMBERS = {"state_weight": [100.0, 100.0, 1.0, 1.0], "input_weight": [0.1]}
SIZES = {"weights": {"joints": "1 deg", "rates": "5 deg/s", "integrals": "0.2 deg s", "input": "0.5 N m"}}
LQR, LQI = ({"name": name, "kind": "frozen-lqr", "phases": 5, **w} for name, w in (("LQR", NUMBERS), ("LQI", SIZES)))
PID = {"kind": "pid", "kp": [3.0], "kd": [0.5], "ki": [2.0]}
FILTERS = [
    {"kind": "low-pass", "on": "rates", "cutoff": "35 Hz", "order": 1},
    {"kind": "notch", "frequency": "4.5 Hz", "damping": 0.3, "gain": 0.2},
]
MOVES = {"kind": "point-to-point", "move_time": 0.4, "dwell_time": 0.1, "joints": [{"waypoints": [0.0, 1.0, 0.4]}]}
SINGLE = {"links.0.modes": 1, "designs": [LQR]}
LINK = {"length": 0.5, "mass_per_length": 0.3, "bending_stiffness": 20.0, "modes": 1}
TWO_LINKS = {
    "links": [LINK, LINK],
    "effects": {
        "gravity": {},
        "payload": {"mass": 0.1},
        "modal_damping": {"ratio": 0.02},
        "hub": {"inertia": [0.05, 0.05]},
    },
    "motion": {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.2}, {"mean": 0.5, "amplitude": 0.2}]},
    "control": {"feedback": {"kind": "pd", "kp": [160.0, 40.0], "kd": [8.0, 2.0]}},
    "designs": [],
}
MASS, FREQUENCY = {"effects.payload.mass": (0, 0.3)}, {"motion.frequency": (0.3, 2)}
GAINS = {"control.feedback.kp.0": (0.5, 20.0), "control.feedback.kd.0": (0.02, 1.0)}
STATES = {"control.filters.1.frequency": (2, 9), "control.feedback.ki.0": (0.1, 20)}
CASES = {
    "random": (SINGLE, "own", MASS | GAINS | FREQUENCY | {"motion.joints.0.amplitude": (0.1, 1.5)}),
    "amplitude": (SINGLE, "open", {"motion.joints.0.amplitude": (0.1, 3)}),
    "breaks": (SINGLE | {"motion": MOVES}, "own", MASS),
    "kept gain": (SINGLE, "LQR", FREQUENCY),
    "states of the controller": (
        SINGLE | {"control.feedback": PID, "control.filters": FILTERS, "designs": []},
        "own",
        STATES | FREQUENCY,
    ),
    "kept gain with integrals": (SINGLE | {"designs": [LQI]}, "LQI", FREQUENCY | MASS),
    "two links": (TWO_LINKS, "own", MASS | {"motion.frequency": (0.3, 1)}),
    "undamped": ({}, "own", {"motion.joints.0.rate": (1.5, 4.5)}),
}


@pytest.mark.parametrize("name", thin(list(CASES)))
def test_the_kernel_agrees_with_floquet_within_its_errors(name):
    changes, word, limits = CASES[name]
    rng = np.random.default_rng(5)
    scene = fl.load_scene("spinning-link" if name == "undamped" else "single-link", changes)
    loop = choose_loop(scene, limits, word)
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


def test_threads_share_values_and_pass_errors_on(monkeypatch):
    """Two threads, one: the same bits. A block that raises ends the sweep with its error."""
    monkeypatch.setattr("flexlin.analyses.sweep.together.BLOCK_VALUES", 8 * 16)
    values = {"effects.payload.mass": np.linspace(0.0, 0.3, 61)}
    job = prepare_job(fl.load_scene("single-link", SINGLE), values, 1e-8, False, "own")
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
    values = {"effects.payload.mass": np.linspace(0.0, 0.3, 800)}
    job = prepare_job(fl.load_scene("single-link", SINGLE), values, 1e-8, False, "own")
    assert job.work.block >= 90
    tried = []

    def misses(self, points, rest, enter):
        return rest

    def slow(self, i, make, tol):
        tried.append(i)
        time.sleep(0.02)
        if i == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(Together, "solve", misses)
    monkeypatch.setattr(Found, "put_alone", slow)
    with pytest.raises(KeyboardInterrupt):
        list(share_among_threads(job, 2))
    assert len(tried) < 20


def test_a_search_learns_what_values_near_by_need(monkeypatch):
    """Values slower than all pilots were computed three times each wherever a boundary was followed among them."""
    family, calls = make_family(fl.load_scene("khang-2019"), {"motion.frequency": (0.1, 6.0)}, "own"), []
    assert family.together is not None
    find_logs = Kernel.find_logs
    monkeypatch.setattr(Kernel, "find_logs", lambda *given: calls.append(given[2]) or find_logs(*given))
    slow = family.rough(np.array([[0.1], [0.102]]))
    first, calls[:] = len(calls), []
    again = family.rough(np.array([[0.1], [0.104]]))
    assert first > len(calls) == 1
    np.testing.assert_allclose(np.sort(again.logs[0].real), np.sort(slow.logs[0].real), atol=1e-6)
