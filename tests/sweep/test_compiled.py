"""The compiled kernel beside NumPy's route, `floquet`, and expressions that hold every operation."""

import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin import compiler
from flexlin.about.kernel_source import write_model
from flexlin.answers.loops import choose_loop
from flexlin.answers.sweep.batches import NumpyBatches
from flexlin.answers.sweep.compiled import CompiledBatches
from flexlin.answers.sweep.job import prepare_job
from flexlin.answers.sweep.run import choose_crew
from flexlin.answers.sweep.threads import Threads
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.many.compiled import CompiledKernel
from flexlin.periodic.many.romberg import balance_states, batched_exponents

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
LQR = {
    "name": "LQR",
    "kind": "frozen-lqr",
    "state_weight": [100.0, 100.0, 1.0, 1.0],
    "input_weight": [0.1],
    "phases": 5,
}
LQI = LQR | {
    "name": "LQI",
    "weights": {"joints": "1 deg", "rates": "5 deg/s", "integrals": "0.2 deg s", "input": "0.5 N m"},
}
LQI = {key: value for key, value in LQI.items() if key not in ("state_weight", "input_weight")}
PID = {"kind": "pid", "kp": [3.0], "kd": [0.5], "ki": [2.0]}
FILTERS = [
    {"kind": "low-pass", "on": "rates", "cutoff": "35 Hz", "order": 1},
    {"kind": "notch", "frequency": "4.5 Hz", "damping": 0.3, "gain": 0.2},
]
MOVES = {"kind": "point-to-point", "move_time": 0.4, "dwell_time": 0.1, "joints": [{"waypoints": [0.0, 1.0, 0.4]}]}
LINKS = [{"length": 0.5, "mass_per_length": 0.3, "bending_stiffness": 20.0, "modes": 1}] * 2
TWO_LINKS = {
    "schema": 1,
    "title": "two links",
    "links": LINKS,
    "effects": {
        "gravity": {},
        "payload": {"mass": 0.1},
        "modal_damping": {"ratio": 0.02},
        "hub": {"inertia": [0.05, 0.05]},
    },
    "motion": {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.2}, {"mean": 0.5, "amplitude": 0.2}]},
    "control": {"feedback": {"kind": "pd", "kp": [160.0, 40.0], "kd": [8.0, 2.0]}},
}
SINGLE = {"links.0.modes": 1, "designs": [LQR]}
CASES = {
    "random": (
        lambda: fl.load_scene("single-link", SINGLE),
        "own",
        {"effects.payload.mass": (0, 0.3), "control.feedback.kd.0": (0, 1)},
    ),
    "amplitude": (lambda: fl.load_scene("single-link", SINGLE), "open", {"motion.joints.0.amplitude": (0.1, 3)}),
    "breaks": (
        lambda: fl.load_scene("single-link", SINGLE | {"motion": MOVES}),
        "own",
        {"effects.payload.mass": (0, 0.3)},
    ),
    "kept gain": (lambda: fl.load_scene("single-link", SINGLE), "LQR", {"motion.frequency": (0.3, 2)}),
    "states of the controller": (
        lambda: fl.load_scene(
            "single-link", SINGLE | {"control.feedback": PID, "control.filters": FILTERS, "designs": []}
        ),
        "own",
        {"control.filters.1.frequency": (2, 9), "control.feedback.ki.0": (0.1, 20), "motion.frequency": (0.3, 2)},
    ),
    "kept gain with integrals": (
        lambda: fl.load_scene("single-link", SINGLE | {"designs": [LQI]}),
        "LQI",
        {"motion.frequency": (0.3, 2), "effects.payload.mass": (0, 0.3)},
    ),
    "two links": (
        lambda: fl.parse_scene(TWO_LINKS),
        "own",
        {"effects.payload.mass": (0, 0.3), "motion.frequency": (0.3, 1)},
    ),
    "undamped": (lambda: fl.load_scene("spinning-link"), "own", {"motion.joints.0.rate": (1.5, 4.5)}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_both_routes_agree_within_their_errors_and_with_floquet(name):
    make, word, limits = CASES[name]
    rng = np.random.default_rng(5)
    loop = choose_loop(make(), limits, word)
    points = np.stack([rng.uniform(low, high, 37) for low, high in limits.values()], axis=1)
    fast = CompiledBatches.prepare(loop, points, 1e-8)
    found, slow = fast.compute(points), NumpyBatches.prepare(loop, points, 1e-8, 2**24).compute(points)
    assert not found.one_by_one.any()
    both = (found.error + slow.error)[:, None]
    distances = np.stack(
        [
            measure_distances(a * T, b * T).min(axis=1) / T
            for a, b, T in zip(found.exponents, slow.exponents, found.period, strict=True)
        ]
    )
    assert np.all(distances <= both)
    assert np.all(found.error <= 1e-8 * np.maximum(1.0, np.abs(found.exponents).max(axis=1)))
    assert np.array_equal(found.verdict == 2, slow.verdict == 2)
    for i in (0, 17, 36):
        exact = fl.floquet(loop.system_at(points[i]), 1e-11)
        apart = measure_distances(found.exponents[i] * exact.period, exact.log_multipliers).min(axis=1) / exact.period
        assert np.all(apart <= found.error[i] + exact.error)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "memory"), [(1, 0), (3, 0), (5, 0), (6, 0), (3, 2), (6, 3)])
def test_every_number_of_coordinates_gives_what_numpy_gives(n, memory):
    """Products in blocks of all shapes: random coefficients with one dominant decay, for 11 values that fill no vector."""
    rng = np.random.default_rng(n)
    constants, parts = rng.uniform(-1, 1, (2, n, n)), rng.uniform(-1, 1, (2, n, n))
    constants = constants * [[[5.0]], [[1.0]]] - np.stack(
        [np.diag(rng.uniform(20, 90, n)), np.diag(np.r_[150.0, np.ones(n - 1)])]
    )
    constants[0, :, n - memory :] = parts[0, :, n - memory :] = 0.0
    entries = [
        f"{name}[{k}] = {float(constants[i].flat[k])!r} + {float(parts[i].flat[k])!r} * p[0] * f[0];"
        for i, name in enumerate("XY")
        for k in range(n * n)
    ]
    model = "\n".join(
        [
            f"enum {{ COORDINATES = {n}, PARAMETERS = 1, PHASE_INPUTS = 1, PHASE_VALUES = 1, POINT_VALUES = 1 }};",
            "static void of_phase(const double *u, double *f) { f[0] = u[0]; }",
            "static v8 of_point(const v8 *p, v8 *w) { w[0] = p[0]; return splat(1.0); }",
            "static m8 at_node(const double *restrict f, const v8 *restrict p, v8 *restrict X, v8 *restrict Y) {",
            *entries,
            "return (m8)(splat(1.0) > 0.0); }",
        ]
    )
    kernel = CompiledKernel(model, n, lambda phases: np.cos(2 * np.pi * phases)[:, None], (), memory)
    p = np.linspace(0, 1, 11)

    def coefficients(phases):
        wave = np.cos(2 * np.pi * phases)[:, None, None, None] * p
        X, Y = (constants[i][..., None] + parts[i][..., None] * wave for i in range(2))
        return X, Y

    scale = balance_states(*coefficients(np.arange(32) / 32), memory)
    logs, errors, sound, _, _ = kernel.find_logs(p[:, None], 12, scale, 1e-12, np.inf)
    other = batched_exponents(coefficients, 48, (), 1e-12, memory=memory)
    assert logs.shape == (11, 2 * n - memory)
    assert sound.all()
    distance = measure_distances(logs.T, other.logs).min(axis=1)
    assert np.all(distance <= errors.T.max(axis=0) + other.errors.max(axis=0))
    assert distance.max() < 1e-7


def test_thousands_of_factors_neither_over_nor_underflow():
    """2400 factors, none of them grouped, whose clusters are multiplied out: as many as 48 give."""
    limits = {"effects.payload.mass": (0, 0.3), "control.feedback.kd.0": (0, 1)}
    loop = choose_loop(fl.load_scene("single-link", SINGLE), limits)
    points = np.random.default_rng(5).uniform(0, [0.3, 0.05], (8, 2))
    work = CompiledBatches.prepare(loop, points, 1e-8)
    coarse, fine = (work.kernel.find_logs(points, K, work.scale, 1e-10, np.inf) for K in (48, 600))
    assert fine[2].all()
    assert measure_distances(coarse[0].T, fine[0].T).min(axis=1).max() < 1e-7
    assert np.all(fine[1] <= 1e-8 * np.maximum(1.0, np.abs(fine[0])))


def test_results_do_not_depend_on_the_blocks_nor_on_pickling():
    loop = choose_loop(fl.load_scene("single-link", SINGLE), ["effects.payload.mass"])
    points = np.linspace(0.0, 0.3, 61)[:, None]
    work = CompiledBatches.prepare(loop, points, 1e-8)
    again = pickle.loads(pickle.dumps(work))
    whole, parts = work.compute(points), [again.compute(points[i : i + 16]) for i in range(0, 61, 16)]
    assert np.array_equal(whole.exponents, np.concatenate([part.exponents for part in parts]))
    assert np.array_equal(whole.error, np.concatenate([part.error for part in parts]))


@pytest.mark.slow
def test_a_worker_loads_no_more_than_the_compiled_code_needs(tmp_path):
    """SciPy, CasADi and the scene's classes take a worker most of a second; values that are left to `floquet` load them."""
    loop = choose_loop(fl.load_scene("single-link", SINGLE), ["effects.payload.mass"])
    points = np.linspace(0.0, 0.3, 24)[:, None]
    work = CompiledBatches.prepare(loop, points, 1e-8)
    (tmp_path / "work").write_bytes(pickle.dumps((work, points)))
    script = (
        "import pickle, sys; from flexlin.answers.sweep.task import compute_blocks\n"
        f"work, points = pickle.load(open({str(tmp_path / 'work')!r}, 'rb')); found = compute_blocks(work, [points])[0]\n"
        "assert not {'scipy', 'casadi', 'pydantic', 'flexlin.scene', 'flexlin.periodic.system'} & set(sys.modules)\n"
        f"pickle.dump(found, open({str(tmp_path / 'found')!r}, 'wb'))\n"
        "points[3] = float('nan'); print(compute_blocks(work, [points])[0].one_by_one.sum())"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], check=True, capture_output=True, text=True)
    assert np.array_equal(pickle.loads((tmp_path / "found").read_bytes()).exponents, work.compute(points).exponents)
    assert int(done.stdout) >= 1


def test_threads_share_values_and_pass_errors_on(monkeypatch):
    """Two threads, one: the same bits. A block that raises ends the sweep with its error."""
    monkeypatch.setattr("flexlin.answers.sweep.compiled.PAYS", 0.0)
    monkeypatch.setattr("flexlin.answers.sweep.compiled.BLOCK_WORK", 1.0)
    values = {"effects.payload.mass": np.linspace(0.0, 0.3, 61)}
    job = prepare_job(fl.load_scene("single-link", SINGLE), values, 1e-8, False, "own")
    assert len(job.blocks) == 8
    assert isinstance(choose_crew(job), Threads)
    job.run(choose_crew(job, workers=1))
    alone = job.found.exponents.copy()
    job.done[:], job.found.exponents[:] = False, np.nan
    job.run(Threads(2))
    assert job.done.all()
    assert np.array_equal(job.found.exponents, alone)
    job.done[:], job.points[40] = False, np.nan
    monkeypatch.setattr(CompiledBatches, "compute", lambda self, points: 1 / int(np.isfinite(points).all()))
    with pytest.raises(ZeroDivisionError):
        list(Threads(2)(job))


def every_operation(phase, p):
    """One expression each of what the phase, the point, or both decide; all stay where every function is defined."""
    total = 0
    for x in (0.3 + 0.2 * ca.sin(2 * ca.pi * phase), 0.4 + 0.1 * p, 0.5 + 0.05 * p * ca.cos(2 * ca.pi * phase)):
        y = 0.7 * x + 0.01
        total += (
            ca.exp(x)
            + ca.log(x)
            + x**1.7
            + x**p
            + ca.sqrt(x)
            + x * x
            + 2 * x
            + ca.sin(40 * x)
            + ca.cos(900 * x)
            + ca.tan(x)
        )
        total += (
            ca.asin(x) + ca.acos(x) + ca.atan(x) + ca.fabs(-x) + ca.sign(x) + ca.erf(x) + ca.fmin(x, y) + ca.fmax(x, p)
        )
        total += ca.sinh(x) + ca.cosh(x) + ca.tanh(x) + ca.asinh(x) + ca.acosh(1 + x) + ca.atanh(x) + ca.atan2(x, y)
        total += (
            ca.log1p(x) + ca.expm1(x) + ca.hypot(x, p) + ca.copysign(x, -p) + ca.floor(x) + ca.ceil(x) + 1 / (1 + p)
        )
        total += ca.if_else(ca.logic_and(x < p, x <= 3), x, -x) + ca.if_else(ca.logic_or(x != y, x == p), 1, y)
        total += ca.if_else(ca.logic_not(x > p), x, y) + ca.remainder(x, 0.9 + y) + ca.fmod(x + 3, 1 + p)
    return total


def test_every_operation_means_the_same_in_c():
    """Coefficients with all operations, M not diagonal, by C and by CasADi: the same logs from both."""
    phase, p = ca.SX.sym("phase"), ca.SX.sym("p")
    s = 0.002 * every_operation(phase, p)
    M = ca.vertcat(ca.horzcat(2 + s**2, 0.3), ca.horzcat(0.3, 1 + p))
    D = ca.vertcat(ca.horzcat(0.1, s), ca.horzcat(-s, 0.2))
    K = ca.vertcat(ca.horzcat(5 + s, 0.2), ca.horzcat(s, 3))
    matrices = ca.Function("m", [phase, p], [ca.densify(x) for x in (M, D, K)])
    duration = ca.Function("T", [p], [1 + p / 9])
    fake = SimpleNamespace(matrices=matrices, duration=duration, coordinates=2, kept=None, paths=("p",))
    kernel = CompiledKernel(write_model(fake), 2, lambda phases: phases[:, None])
    points = np.linspace(0.6, 0.9, 11)[:, None]
    T = 1 + points[:, 0] / 9

    def coefficients(phases):
        values = np.array([[np.array(matrices(f, q)) for q in points[:, 0]] for f in phases])
        M, D, K = (values[:, :, i] for i in range(3))
        return (np.moveaxis(-np.linalg.solve(M, A * scale[:, None, None]), 1, -1) for A, scale in ((K, T * T), (D, T)))

    logs, _, sound, periods, work = kernel.find_logs(points, 8, np.ones(4), 1e-11, np.inf, tol=np.inf)
    other = batched_exponents(coefficients, 8, (), 1e-11)
    assert sound.all()
    assert other.sound.all()
    assert np.all(work == 8 * (2 + 3 + 4))
    assert np.allclose(periods, T, rtol=1e-15)
    assert measure_distances(logs.T, other.logs).min(axis=1).max() < 1e-11


def test_only_a_folder_of_the_users_own_is_trusted(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    compiler.cache_folder.cache_clear()
    own = compiler.cache_folder()
    assert own == tmp_path / "flexlin"
    assert own.stat().st_mode & 0o077 == 0
    own.chmod(0o777)
    compiler.cache_folder.cache_clear()
    assert compiler.cache_folder() != own
    compiler.cache_folder.cache_clear()


def test_without_a_compiler_numpy_does_the_work(monkeypatch):
    monkeypatch.setattr("flexlin.answers.sweep.compiled.PAYS", 0.0)
    scene, values = fl.load_scene("single-link", SINGLE), {"effects.payload.mass": [0.0, 0.1]}
    fast = fl.sweep(scene, values)
    monkeypatch.setattr("flexlin.answers.sweep.compiled.find_compiler", lambda: None)
    slow = fl.sweep(scene, values)
    assert (fast.attrs["route"], slow.attrs["route"]) == ("compiled", "numpy")
    assert np.allclose(fast["exponents"], slow["exponents"], rtol=1e-8)
