"""Answers to disturbances: against integrators that share nothing with them, by their order in the size, and as a command."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from flexlin.analyses import answer_noise, overshoot, respond, settling_time, state_disturbance
from flexlin.analyses.disturbed import PushedLoop
from flexlin.analyses.disturbed.stated import Directions
from flexlin.cli import main
from flexlin.errors import ArgumentError
from flexlin.report.figures.answers import draw_answer
from tests import closed_arm
from tests.periodic.dense import integrate
from tests.thinned import thin

SMALL = {"links.0.modes": 1, "designs": []}


@pytest.fixture(scope="module")
def closed():
    return closed_arm.closed("single-link", SMALL)


def tip_and_force(lin, t):
    """The tip's slope across the rigid link (N, n) and M^-1 J' (N, 2n), by differences of the arm's own points."""
    h, n = 1e-6, lin.n
    points = lambda y: lin.about.of_arm("points", t, np.tile(y, (len(t), 1)))  # noqa: E731
    chord = np.diff(points(np.zeros(n))[:, :, -2:], axis=2)[:, :, 0]
    e = np.stack([-chord[:, 1], chord[:, 0]], axis=1) / np.linalg.norm(chord, axis=1)[:, None]
    J = np.stack([(points(h * y) - points(-h * y))[:, :, -1] / (2 * h) for y in np.eye(n)], axis=2)
    across = np.einsum("td,tdn->tn", e, J)
    return across, np.concatenate([0 * across, np.linalg.solve(lin.M(t), across[:, :, None])[:, :, 0]], axis=1)


@pytest.mark.slow
def test_a_push_is_answered_as_by_dop853(closed):
    """At two phases, with a push longer than the distance of two phases; the tip by differences of positions."""
    found = respond(closed, state_disturbance("push", "tip 0.2 N 0.3 s", closed), periods=0.5)
    grid = np.linspace(0, 0.9, 1201)
    stops = np.union1d(found.t[found.t <= 0.9], [0.3])
    for k in (0, 5):
        t = found.phases[k] * closed.period + grid
        A, across, reach = (CubicSpline(grid, of) for of in (closed.A(t), *tip_and_force(closed, t)))
        x = integrate(lambda t, x, A=A, reach=reach: A(t) @ x + 0.2 * (t < 0.3) * reach(t), np.zeros(4), stops)
        exact = np.einsum("tn,tn->t", across(stops), x[:, :2])[np.isin(stops, found.t)]
        assert np.abs(found.linear[k, : len(exact)] - exact).max() < 1e-6 * np.abs(exact).max()


HALVES = [
    ("initial", "w11=2 mm", "w11=1 mm"),
    ("step", "joint 1 torque 0.02 N m", "joint 1 torque 0.01 N m"),
    ("push", "tip 0.2 N 20 ms", "tip 0.1 N 20 ms"),
]


@pytest.mark.parametrize(("kind", "words", "half"), thin(HALVES))
def test_the_nonlinear_answer_tends_to_the_linear_one(kind, words, half):
    """What a disturbance of a third of a steady motion's size moves is linear but for that motion; its own part falls with its size."""
    lin = closed_arm.closed("single-link", {**SMALL, "motion.joints.0.amplitude": 1e-4, "effects.gravity": "off"})
    large, small = (respond(lin, state_disturbance(kind, text, lin)) for text in (words, half))
    assert large.problem == ""
    assert small.difference < 0.6 * large.difference < 0.02 or large.difference < 2e-5
    np.testing.assert_allclose(large.linear, 2 * small.linear, atol=1e-9 * large.peak)
    assert np.isfinite(large.settling).all()


def test_a_push_reaches_an_arm_whose_joint_may_stick():
    """While it is pushed its friction is the smooth one, with `static` as without."""
    t, found = np.linspace(0.0, 0.05, 6), []
    for static in ({}, {"static": 0.012}):
        friction = {"torque": 0.01, "rate": 0.01} | static
        lin = closed_arm.closed("single-link", {**SMALL, "effects.coulomb_friction": friction})
        pushed = [PushedLoop(lin, lin.law, Directions(lin), size) for size in (0.0, 0.5)]
        found += [one.integrate(t, np.zeros(4), 1e-8) for one in pushed]
    assert np.abs(found[1] - found[0]).max() > 1e-3
    np.testing.assert_allclose(found[3], found[1], atol=1e-7)


def test_a_step_ends_where_the_stiffness_holds_it():
    """A constant loop: y ends at K^-1 B u."""
    lin = closed_arm.closed("single-link", {**SMALL, "motion.joints.0.amplitude": 0.0})
    found = respond(lin, state_disturbance("step", "joint 1 torque 0.1 N m", lin))
    end = np.linalg.solve(lin.K(0.0), lin.B(0.0) @ [0.1])
    assert found.linear[0, -1] == pytest.approx(tip_and_force(lin, np.zeros(1))[0][0] @ end, rel=2e-3)
    assert np.ptp(found.settling) < 1e-9


def test_noise_spreads_as_many_runs_do(closed):
    """White torque on a held grid: 400 runs by the discrete transition of the loop, beside the covariance."""
    system, rng, steps = closed.periodic_system(), np.random.default_rng(4), 400
    found = answer_noise(closed, state_disturbance("noise", "torque 0.05 N m 200 Hz", closed), system)
    h, x = closed.period / steps, np.zeros((400, 4))
    t = h * (np.arange(steps) + 0.5)
    for A, B in zip(np.tile(system.A(t), (4, 1, 1)), np.tile(closed.input_matrix(t), (4, 1, 1)), strict=True):
        push = rng.normal(size=(400, 1)) * np.sqrt(0.05**2 / 400 / h) @ B.T
        x = x + h * ((x + h / 2 * (x @ A.T + push)) @ A.T + push)
    np.testing.assert_allclose(x.std(axis=0)[:2], found.states[0, :2], rtol=0.12)
    assert found.tip.min() > 0


def test_settling_and_overshoot_of_known_curves():
    t = np.linspace(0, 10, 2001)
    zero, one, decay = 0 * t, 0 * t + 1, np.exp(-t)
    dip = np.exp(-np.pi / 3)
    assert overshoot(1 - decay * (np.cos(3 * t) + np.sin(3 * t) / 3), one) == pytest.approx(dip, rel=1e-4)
    assert overshoot(decay * np.cos(3 * t), zero) == pytest.approx(dip * 0.95, abs=0.06)
    assert settling_time(t, decay, zero) == pytest.approx(np.log(50), abs=0.01)
    assert settling_time(t, one, zero) == np.inf


def test_the_command_writes_page_and_numbers(tmp_path, capsys):
    words = ["respond", "single-link", "--set", "links.0.modes=1", "drives={torque={peak=0.5}}", "--out", str(tmp_path)]
    assert main([*words, "--push", "tip 0.1 N 20 ms", "--loop", "periodic LQR", "--tol", "1e-6"]) == 0
    data, said = json.loads((tmp_path / "respond.json").read_text()), capsys.readouterr().out
    assert len(data["linear"]) == len(data["phases"]) == 16
    assert data["nonlinear"] is not None
    assert "--push" in (tmp_path / "respond.html").read_text()
    for words in ("settles to 2 % in", "mm at the most", "above the drive: peak torque of q1"):
        assert words in said


REFUSED = [
    ("step", "joint 2 torque 1 N m", "a joint from 1 to 1"),
    ("step", "joint 1 torque 1 mm", "a torque"),
    ("initial", "w19=1 mm", "w11"),
    ("initial", "q1=1 mm", "an angle"),
    ("initial", "", "pairs|w11"),
    ("push", "tip 1 mm 20 ms", "tip 1 N"),
    ("push", "tip 1 N -20 ms", "greater than 0"),
    ("noise", "torque 0.1 N m", "100 Hz"),
    ("noise", "torque -0.1 N m 100 Hz", "greater than 0"),
]


@pytest.mark.parametrize(("kind", "words", "expected"), REFUSED)
def test_words_that_say_nothing_are_refused(closed, kind, words, expected):
    with pytest.raises(ArgumentError, match=expected):
        respond(closed, state_disturbance(kind, words, closed))


def test_what_settles_at_no_phase_is_said_so(closed):
    found = respond(closed, state_disturbance("push", "tip 0.2 N 0.3 s", closed), periods=0.25)
    said = draw_answer(replace(found, settling=np.full(len(found.settling), np.inf))).caption
    assert "has not settled after" in said
    assert "nor has it at any other" in said
