"""Numbers found from synthetic logs, made by SciPy's integrator with noise."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

import flexlin as fl
from flexlin.errors import ArgumentError
from flexlin.identification import Logged, Windows, maximum_likelihood, prepare
from flexlin.identification.least_squares import Problem, find_colour, solve
from flexlin.scene import get_value, revise_scene
from tests.identification.logs import coordinate, simulated, swing, tip
from tests.thinned import thin

TIME = np.arange(400) * 0.005
LOG = {"inputs": {"q1": {"column": "u"}}, "outputs": {"q1": {"column": "q"}}}
RUBBING = {"links.0.modes": 1, "designs": [], "log": LOG, "effects.viscous_friction": {"coefficient": 0.05}}
BODY = {"links.0.modes": 0, "links.0.mass_per_length": 0.0, "designs": [], "log": LOG}
FREE = ["effects.payload.mass", "links.0.bending_stiffness", "effects.viscous_friction.coefficient"]
SENSORS = {"q1": coordinate("q1"), "tip.x": tip(0), "tip.y": tip(1)}
GAIN, OFFSET = "log.inputs.q1.gain", "log.outputs.q1.offset"
NOISE = {"q1": 1e-3, "tip.x": 5e-4, "tip.y": 5e-4}


SCENE = fl.load_scene("single-link", RUBBING)
TORQUE = 0.3 * swing(TIME)[0]


@cache
def clean():
    """What the sensors read without noise."""
    return simulated(SCENE, TIME, lambda t: 0.3 * swing(t), SENSORS)[0]


def noisy(readings, seed=3, noise=NOISE, time=TIME, torques=(TORQUE,)):
    """A log; where readings are missing, those that are clean."""
    rng = np.random.default_rng(seed)
    measured = {k: values + noise[k] * rng.standard_normal(len(time)) for k, values in readings.items()}
    return fl.Log(time, {f"q{k + 1}": torque for k, torque in enumerate(torques)}, measured)


@cache
def usual(seed=3):
    return noisy(clean(), seed)


def fit(scene, log=None, free=FREE, **more):
    """The numbers found in windows of 1 s, from one start."""
    return fl.identify(scene, usual() if log is None else log, free, **{"window": 1.0, "starts": 1} | more)


def is_near(found, scene=SCENE):
    """Whether some numbers are known, and all as near to their true ones as three and a half of their errors."""
    known = found.values.items()
    return len(known) > 0 and all(abs(x - get_value(scene, path)) < 3.5 * found.errors[path] for path, x in known)


def beside(scene, paths, seed=0):
    """The scene with other numbers, from which the search begins."""
    rng = np.random.default_rng(seed)
    return revise_scene(scene, {p: get_value(scene, p) * float(np.exp(rng.uniform(-0.4, 0.4))) for p in paths})


@pytest.mark.parametrize(("path", "start"), thin([(FREE[0], 0.0), (OFFSET, 0.0), (OFFSET, 0.01)], 2))
def test_numbers_that_are_zero_in_the_scene_or_in_truth_are_found(path, start):
    """No bound ties them to zero; and a log that says so within a small error does know it, however little is left of a size."""
    assert is_near(fit(revise_scene(SCENE, {path: start}), free=[path]))


@pytest.mark.slow
def test_numbers_are_handed_back_when_the_time_ends_first():
    """They are then not the most likely ones, and what errors they have nobody knows."""
    found = fl.identify(beside(SCENE, FREE), usual(), FREE, window=1.0, seconds=1e-6)
    assert "allow more" in found.status
    assert (found.settled, set(found.values), found.scene.uncertainty) == (False, set(FREE), {})
    assert np.isnan([*found.errors.values(), *found.covariance.flat]).all()
    assert found.fit == pytest.approx(fl.predict(found.scene, usual(), window=1.0).fit)


@pytest.mark.parametrize("seed", thin(range(4)))
def test_a_search_that_cannot_step_does_not_pass_for_settled(monkeypatch, seed):
    """Numbers that stay because no step gains are not those of the minimum: it is said, or their errors are as large as they are off."""
    monkeypatch.setattr(maximum_likelihood, "solve", lambda problem, point, *rest, **more: point)
    stuck = fit(beside(SCENE, FREE, seed))
    assert "no step gains" in stuck.status or is_near(stuck)


def test_rounds_that_end_before_the_numbers_stay_are_no_settled_search(monkeypatch):
    monkeypatch.setattr(maximum_likelihood, "ROUNDS", 1)
    found = fit(beside(SCENE, FREE))
    assert not found.settled
    assert "rounds ended before the search had settled" in found.status
    assert np.isnan(list(found.errors.values())).all()


@pytest.mark.slow
def test_what_goes_together_is_named_and_not_returned():
    """The torque's gain, with all inertias and stiffnesses, scales the equations: none of them is known alone."""
    scene = fl.load_scene("single-link", RUBBING | {"effects.gravity": "off"})
    scaled = ["log.inputs.q1.gain", "links.0.mass_per_length", "links.0.bending_stiffness"]
    others = ["effects.payload.mass", "effects.hub.inertia", "effects.viscous_friction.coefficient"]
    log = noisy(simulated(scene, TIME, lambda t: 0.3 * swing(t), SENSORS)[0])
    found = fit(scene, log, [*scaled, *others, "effects.modal_damping.ratio"])
    together = {path for group in found.unknown for path in group}
    assert set(scaled) <= together
    assert not together & set(found.values)
    assert found.fit == fl.predict(found.scene, log, window=1.0).fit
    assert "cannot be parted by this log" in found.status


def test_a_spring_that_goes_soft_does_not_become_stiff():
    """A stiffness of 0 in a list stands for a stiff joint: a search that came to it handed one back, or ended in an error."""
    effects = {"hub": {"inertia": 1.0}, "joint_flexibility": {"stiffness": [0.1], "motor_inertia": [0.02]}}
    scene, still = fl.load_scene("single-link", BODY | {"effects": effects}), noisy({"q1": 0 * TIME}, 2)
    found = fit(scene, still, ["effects.joint_flexibility.stiffness.0"])
    assert 0 < found.scene.effects.joint_flexibility.stiffness[0] < 0.01


@pytest.mark.slow
def test_numbers_that_make_up_for_a_wrong_sign_are_named(monkeypatch):
    """Each round takes them further, so the search does not settle."""
    monkeypatch.setattr(maximum_likelihood, "ROUNDS", 6)
    said = fit(SCENE, noisy(clean(), torques=[-TORQUE])).status
    assert "effects.viscous_friction.coefficient went far from the scene's" in said.replace(f"{FREE[0]}, ", "")
    assert "check signs" in said


@pytest.mark.slow
def test_a_dead_sensor_pulls_at_no_number():
    log = noisy({**clean(), "tip.x": 0 * TIME}, noise={**NOISE, "tip.x": 0.0})
    found = fit(beside(SCENE, FREE), log)
    assert (found.settled, set(found.values)) == (True, set(FREE))
    assert is_near(found)
    assert np.isnan([found.fit["tip.x"], found.noise["tip.x"]]).all()
    assert "tip.x is constant" in found.status


def problem_of(scene, log, free, window):
    """The least squares of a log about the scene's numbers, and these."""
    model = Logged.of(scene, log, free)
    p = model.arm.parameters.values
    shooting = prepare(model, Windows.of(log, window), p)
    return Problem(shooting, shooting.windows.readings(), np.ones(len(log.outputs)), 0 * p, 10 * p, p), p


def test_slopes_of_windows_that_diverge_are_no_warning():
    """NumPy warned of overflow to users whose log was in degrees and millimetres; that the windows diverge is said in words."""
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "effects.geometric_stiffening": "off", "designs": []})
    log = noisy({"q1": TIME[:120], "tip.y": TIME[:120]}, time=TIME[:120], torques=[swing(TIME[:120])[0]])
    problem, p = problem_of(scene, log, FREE[:1], 0.3)
    point = problem.at(np.tile([0.0, 0.0, 500.0, 0.0], (2, 1)), p)
    assert np.isinf(point.costs).all()
    assert problem.slopes(point).shape == (2, 120, 5)


def test_slopes_whose_squares_overflow_are_no_warning():
    """Sizes of numbers became zero, by which their bounds were divided; a window that diverges passed for white."""
    problem, p = problem_of(SCENE, usual(), FREE, 1.0)
    point = problem.at(np.zeros((2, 4)), p)
    problem.slopes(point)
    point.jacobian = point.jacobian * np.where(np.arange(7) < 6, 1.0, 1e200)
    assert np.isfinite(solve(problem, point, 1).p).all()
    assert find_colour(problem, replace(point, residual=1e160 * point.residual))[1]


@pytest.mark.slow
def test_coloured_residuals_widen_the_errors():
    """Twelve draws miss the true numbers by what is stated; by sums over eight blocks that was half of it."""
    found = []
    for seed in range(12):
        slow = lfilter([0.6], [1, -0.8], np.random.default_rng(seed).normal(size=(3, len(TIME))))
        read = {name: clean()[name] + NOISE[name] * one for name, one in zip(NOISE, slow, strict=True)}
        found.append(fit(SCENE, fl.Log(TIME, {"q1": TORQUE}, read)))
    assert all("coloured" in one.status and one.colour["q1"] > 0.3 for one in found)
    off = [[(one.values[path] - get_value(SCENE, path)) / one.errors[path] for path in FREE] for one in found]
    assert np.allclose(np.sqrt(np.mean(np.square(off), axis=0)), 1.0, atol=0.5)


@pytest.mark.parametrize(
    ("free", "said"), [([], "named once each"), (["title"], "cannot be"), (FREE[:1] * 2, "named once each")]
)
def test_paths_that_lead_to_no_number_are_refused(free, said):
    with pytest.raises(ArgumentError, match=said):
        fl.identify(SCENE, usual(), free)


@pytest.mark.slow
def test_numbers_are_found_within_their_errors_and_these_are_those_of_repeated_logs():
    """Eight draws of the noise: true numbers within three errors, and the errors those of the spread within what eight draws say."""
    found = [fit(SCENE, usual(seed)) for seed in range(8)]
    values, errors = (
        np.array([[getattr(one, of)[path] for path in FREE] for one in found]) for of in ("values", "errors")
    )
    true = np.array([get_value(SCENE, path) for path in FREE])
    assert np.mean(np.abs(values - true) < 3 * errors) >= 0.95
    assert np.allclose(np.std(values, axis=0, ddof=1) / errors.mean(axis=0), 1.0, atol=0.6)
    assert np.all(errors < 0.03 * true)
    for one in found:
        assert one.status.startswith("all numbers are known")
        assert all(one.noise[name] == pytest.approx(NOISE[name], rel=0.1) for name in NOISE)
        for path, value in one.values.items():
            assert get_value(one.scene, path) == value
            ends = one.scene.uncertainty[path]
            assert ends.high - ends.low == pytest.approx(4 * one.errors[path])


def test_the_error_of_a_linear_fit_is_that_of_the_textbook():
    """s^2 (X' X)^-1 with s^2 = |r|^2 / (N - P): four windows of 25 samples spend eight starting values, which made errors 5 % too small."""
    t = np.arange(100) * 0.01
    read = -np.sin(9 * t) / 81 + 1e-3 * np.random.default_rng(2).normal(size=100)
    log = fl.Log(t, {"q1": np.sin(9 * t)}, {"q1": read})
    found = fit(fl.load_scene("single-link", BODY | {"effects": {"hub": {"inertia": 1.0}}}), log, [GAIN], window=0.25)
    X = np.hstack([np.kron(np.eye(4), np.vander(t[:25], 2)), -np.sin(9 * t)[:, None] / 81])
    numbers, (left,), *_ = np.linalg.lstsq(X, read, rcond=None)
    error = np.sqrt(left / (100 - 9) * np.linalg.inv(X.T @ X)[-1, -1])
    np.testing.assert_allclose([found.values[GAIN], found.errors[GAIN]], [numbers[-1], error], rtol=1e-4)


@pytest.mark.parametrize(("sliding", "static", "rate"), thin([(1.4, 1.9, 0.02), (0.9, 0.9, 0.05), (1.4, 1.9, 0.05)]))
def test_numbers_that_bound_each_other_are_found(sliding, static, rate):
    """Static friction is at least the sliding one: no step leads to a scene that is refused, and neither number has a bound of its own.

    Steps of the log's length made numbers of sharp friction seven errors wrong.
    """

    def torque(t):
        return sliding / 0.9 * (2.5 * np.sin(2.1 * t) + np.sin(5.3 * t + 1))

    def motion(t, x):
        friction = (sliding + (static - sliding) * np.exp(-((x[1] / 0.3) ** 2))) * np.tanh(x[1] / rate)
        return [x[1], (torque(t) - friction) / 0.5]

    t = np.arange(600) * 0.01
    angle = solve_ivp(motion, (0, 6), [0, 0], t_eval=t, rtol=1e-8, atol=1e-10, method="LSODA").y[0]
    friction = {"torque": sliding, "static": static, "stribeck": 0.3, "rate": rate}
    effects = {"hub": {"inertia": 0.5}, "coulomb_friction": friction}
    scene = fl.load_scene("single-link", BODY | {"effects": effects})
    log = fl.Log(t, inputs={"q1": torque(t)}, outputs={"q1": angle + 1e-4 * np.random.default_rng(1).normal(size=600)})
    free = ["effects.coulomb_friction.torque", "effects.coulomb_friction.static"]
    found = fit(revise_scene(scene, dict(zip(free, (0.5, 0.55), strict=True))), log, free, window=2.0)
    np.testing.assert_allclose(list(found.values.values()), [sliding, static], rtol=0.02)
    assert is_near(found, scene)
    assert found.scene.effects.coulomb_friction.torque == found.values[free[0]]


def test_a_part_too_short_to_be_kept_back_is_refused_before_the_search(monkeypatch):
    monkeypatch.setattr(maximum_likelihood, "choose_start", None)
    with pytest.raises(ArgumentError, match="the log is too short; got 4 samples"):
        fl.identify(SCENE, usual(), FREE, hold_back=0.01)


@pytest.mark.parametrize(("every", "seen"), thin([(10, False), (1, True)]))
def test_a_vibration_faster_than_half_of_the_sampling_is_named(every, seen):
    some = {name: values[::every] for name, values in clean().items()}
    log = noisy(some, time=TIME[::every], torques=[TORQUE[::every]])
    assert ("faster than half" in fl.identify(SCENE, log, FREE[:1], starts=1).status) is not seen


@pytest.mark.parametrize(("slow", "tried"), thin([(2e-3, True), (0.0, False)]))
def test_coloured_residuals_let_other_starts_be_tried(monkeypatch, slow, tried):
    """However small: one start in ten of random two-link arms ended within a fiftieth of the readings, and 30 errors off, for good."""
    readings, chosen, real = clean(), [], maximum_likelihood.choose_start
    weighed, weigh = [], maximum_likelihood.weigh_evidence
    monkeypatch.setattr(maximum_likelihood, "weigh_evidence", lambda *a: weighed.append(len(chosen)) or weigh(*a))
    monkeypatch.setattr(maximum_likelihood, "choose_start", lambda *given: chosen.append(real(*given)) or chosen[-1])
    fl.identify(SCENE, noisy({**readings, "q1": readings["q1"] + slow * np.sin(7 * TIME)}), FREE, window=1.0)
    assert len(chosen) == tried
    assert set(weighed) == {0}  # where the first search passed no other goes on: it would end there too


@pytest.mark.parametrize("worse", thin([0, 1]))
def test_of_two_ends_the_likelier_is_kept(monkeypatch, worse):
    ends, real = [], maximum_likelihood.refine

    def refine(*given):
        end = real(*given)
        off = end.problem.at(end.point.start, (1.2 if len(ends) == worse else 1.0) * end.point.p)
        ends.append(replace(end, point=off, settled=False))
        return ends[-1]

    monkeypatch.setattr(maximum_likelihood, "refine", refine)
    found = fit(SCENE, starts=2)
    assert len(ends) == 2
    np.testing.assert_allclose(found.values[FREE[0]], get_value(SCENE, FREE[0]), rtol=1e-2)


def test_a_search_goes_on_while_numbers_move_by_more_than_their_errors(monkeypatch):
    """Moves of a thousandth passed for none, where the log knew the number ten times better: one arm in ten was five errors off."""
    monkeypatch.setattr(maximum_likelihood, "ROUNDS", 3)
    creep = lambda problem, point, *rest, **more: problem.at(point.start, point.p * 0.9995)  # noqa: E731
    monkeypatch.setattr(maximum_likelihood, "solve", creep)
    assert not fit(SCENE, free=FREE[:1]).settled


@pytest.mark.slow
def test_a_start_whose_vibrations_slip_by_a_cycle_is_left():
    """Over whole windows the own numbers lead to another minimum, which meets the readings within a tenth; over their heads they do not."""
    links = [
        {"name": "a", "length": 0.75, "mass_per_length": 0.32, "bending_stiffness": 4.4, "modes": 1},
        {"name": "b", "length": 0.99, "mass_per_length": 0.56, "bending_stiffness": 14.0, "modes": 1},
    ]
    effects = {"hub": {"inertia": [0.04, 0.0028]}, "payload": {"mass": [0.39, 0.25]}, "modal_damping": {"ratio": 0.02}}
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.3}, {"amplitude": 0.2}]}
    scene = fl.parse_scene({"schema": 1, "title": "two", "links": links, "effects": effects, "motion": motion})
    time, sensors = np.arange(600) * 0.01, {"q2": coordinate("q2"), **SENSORS}
    torques = np.array([[0.3], [0.21]]) * swing(time, 2)
    readings = simulated(scene, time, lambda t: np.array([0.3, 0.21]) * swing(t, 2), sensors)[0]
    log = noisy(readings, 0, {"q2": 1e-3, **NOISE}, time, torques)
    free = {"effects.payload.mass.1": 0.7, "links.0.bending_stiffness": 1.4, "links.1.bending_stiffness": 1.4}
    start = revise_scene(scene, {path: get_value(scene, path) * factor for path, factor in free.items()})
    found = fl.identify(start, log, list(free))
    assert set(found.values) == set(free)
    assert is_near(found, scene)
    assert "coloured" in fl.identify(start, log, list(free), starts=1).status
