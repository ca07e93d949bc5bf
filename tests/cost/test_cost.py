"""The figures of cost: every stage is there, errors fall as settings get finer, and the cheapest is the cheapest."""

import json
import math
import re
import time
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import accuracy as own
from flexlin.analyses.accuracy import CostResult, Row, cost, scipy_methods
from flexlin.analyses.accuracy.result import Trial, compare_exponents, measure_trials
from flexlin.checks import SAMPLES
from flexlin.cli import main
from flexlin.errors import InputError
from flexlin.periodic import Setting, periodic_riccati
from flexlin.plots import Panel
from flexlin.report import draw_cost, summarise_cost, to_json
from flexlin.report.figures.cost import draw_choices

SOLVED = ("exponents", "periodic Riccati", "forced response")
STAGES = {*SOLVED, "coefficients", "transition matrices", "simulation", "number of modes", "Taylor order"}


@pytest.fixture(scope="module")
def scene():
    overrides = {"links.0.modes": 1, "designs": [], "effects.hub.inertia": 0.02, "control.feedback.kd.0": 0.1}
    return fl.load_scene("single-link", overrides)


@pytest.fixture(scope="module")
def result(scene):
    with pytest.MonkeyPatch.context() as patch:  # all trials, however slow the machine
        patch.setattr("flexlin.analyses.accuracy.result.STAGE_SECONDS", 600.0)
        return cost(scene, peers=False, seconds=1e4)


@pytest.mark.slow
def test_every_stage_reaches_the_floor_at_its_order_and_the_engines_choices_their_tol(result):
    for stage in ("coefficients", "transition matrices", *SOLVED):
        rows = result.stage(stage)
        assert min(row.error for row in rows) < 1e-9, stage
        assert all(row.seconds > 0 for row in rows)
    assert {row.stage for row in result.rows} >= {"number of modes", "Taylor order"}
    assert result.floor < 1e-11
    assert result.notes == ()
    gauss = {row.setting: row.error for row in result.stage("transition matrices") if row.method == "gauss 8"}
    assert np.log2(gauss["32 segments"] / gauss["64 segments"]) == pytest.approx(8, abs=0.7)
    orders = [row.error for row in result.stage("Taylor order")]
    assert orders == sorted(orders, reverse=True)
    for stage in (*SOLVED, "simulation"):
        marked = {float(row.chosen): row for row in result.stage(stage) if row.chosen}
        assert sorted(marked) == sorted(own.MEASURED_TOLS)
        assert all(row.error <= tol for tol, row in marked.items()), stage


def test_recommendations_of_a_table_whose_answer_is_known():
    """Found out: another program or another stage recommended, one that is fast but too coarse, a repeated row."""
    known = {"coarse": (3e-3, 1.0), "middle": (2e-5, 2.0), "slow and worse": (9e-5, 7.0), "fine": (1e-9, 5.0)}
    coarse, middle, slow, fine = (Row("exponents", "own", name, *figures) for name, figures in known.items())
    outside = Row("exponents", "another program", "fast", 1e-11, 0.1, outside=True)
    elsewhere = Row("forced response", "own", "of another stage", 1e-12, 0.1)
    table = CostResult("by hand", (slow, fine, outside, coarse, elsewhere, middle), 1e-14)
    found = [(accuracy, row) for stage, accuracy, row in table.recommendations() if stage == "exponents"]
    assert found == [(1e-2, coarse), (pytest.approx(1e-3), middle), (pytest.approx(1e-5), fine)]
    assert table.cheapest("exponents", 1e-10) is None


@pytest.mark.slow
@pytest.mark.parametrize(("method", "tol"), [("DOP853", 1e-9), ("Radau", 1e-7)])
def test_scipy_answers_the_same_questions(scene, method, tol):
    """By stepping, where two columns swapped, or a buffer overwritten, would be found out: only M, D, K, h and B are shared.

    The loop's right-hand side is made from the residual by elimination; `simulate` never solves for the accelerations so.
    """
    arm = fl.build_manipulator(scene)
    closed, plant = fl.linearize(arm, scene.motion, scene.control), fl.linearize(arm, scene.motion)
    t, weights = closed.period * np.arange(32) / 32, (np.eye(4), np.eye(1))
    transition = own.multiply_period(closed.periodic_system(), Setting("gauss", 20, 64, ""))
    run = fl.simulate(closed, 1.0, tol=1e-10, points_per_period=SAMPLES).nonlinear
    response = fl.forced_response(closed.periodic_system(), closed.forcing)(t)
    X = periodic_riccati(plant.periodic_system(), *weights).X(t)
    for lin, derive, integrate, share, exact in (
        (closed, scipy_methods.derive_transition_rate, scipy_methods.multiply_up, 1.0, transition),
        (closed, scipy_methods.derive_loop_rate, scipy_methods.integrate_loop, 0.1, run),
        (closed, scipy_methods.derive_response_rate, scipy_methods.respond_periodically, 0.1, response),
        (plant, scipy_methods.derive_riccati_rate, scipy_methods.forget_start, 0.1, X),
    ):
        found = integrate(scipy_methods.FastRate(derive(lin), lin.arm.parameters.values), 4, method, share * tol)
        assert np.abs(found - exact).max() < 1e-5 * np.abs(exact).max()


def test_a_stage_ends_in_time_and_keeps_what_it_has():
    """The first trial counts, one that never ends has no row, and none is begun after that."""

    def endless() -> None:
        while True:
            time.sleep(0.001)

    late = Mock(return_value=1.0)
    trials = [Trial("a", "quick", lambda: 1.0), Trial("b", "endless", endless), Trial("c", "late", late)]
    assert [row.setting for row in measure_trials("exponents", trials, lambda value: 0.5, 0.2)] == ["quick"]
    assert not late.called


def test_what_little_time_leaves_out_is_said(scene):
    late = cost(scene, seconds=1e-3)
    told = {re.split(r":| left out", note)[0] for note in late.notes}
    assert told | {row.stage for row in late.rows} >= STAGES  # a stage without a row is never passed over
    assert len(told) >= 3
    assert len(late.rows) < 35
    assert not any(re.search(r"(?<!\w)-\d", note) for note in late.notes)
    without = replace(late, floor=math.nan)  # for two references there was no time
    assert "nan" not in draw_cost(without).caption
    assert '"floor": null' in to_json(without.record())


def test_the_summary_says_what_each_tol_costs_and_where_it_is_missed():

    def summarise(*found):
        rows = [Row("exponents", "floquet, auto", "", error, cost, f"{tol:.0e}") for tol, error, cost in found]
        other = Row("transition matrices", "gauss 8", "8 segments", 1e-9, 1.0, "1e-06")
        return summarise_cost(CostResult("by hand", (*rows, other), 1e-14))

    assert summarise((1e-6, 2e-7, 0.0123), (1e-10, 3e-9, 1.5)) == [
        "exponents: tol 1e-06 costs 12 ms, 1e-10 1.5 s (reaches 3e-09)",
        "the default is tol 1e-09; --tol or the scene's [accuracy] changes it",
    ]
    assert summarise() == []
    said = summarise((1e-4, 5e-5, 0.36), (1e-9, 5e-10, 0.35), (1e-10, 5e-11, 0.38))[0]
    assert said == "exponents: every tol from 1e-04 to 1e-10 costs about 380 ms"


def test_the_engines_choices_are_a_staircase_in_any_order_of_noise():
    """Least time in which an error is reached: never rising with the error, through the cheapest marks."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        tols, seconds = (4, 6, 8, 9, 7), rng.uniform(0.1, 1.0, 5)
        rows = [Row("exponents", "", "", 10.0**-k, s, f"1e-0{k}") for k, s in zip(tols, seconds, strict=True)]
        panel = draw_choices(Panel(), rows)
        line, dots = (next(mark for mark in panel.marks if mark.kind == kind) for kind in ("line", "dots"))
        across, up = np.diff(line.x), np.diff(line.y)
        assert ((across <= 0) & (up >= 0) & (across * up == 0)).all()
        assert line.y[-1] == 1e3 * seconds[3]
        assert len(dots.x) == sum(mark.kind == "words" for mark in panel.marks) == 5
    together = [Row("exponents", "auto", "", 0.0, 0.1, f"1e-0{k}") for k in (4, 6)]
    assert [mark.texts for mark in draw_choices(Panel(), together).marks if mark.kind == "words"] == [("10⁻⁴, 10⁻⁶",)]


def test_exponents_on_the_seam_of_the_frequencies_are_the_same():
    """A negative multiplier has the frequency pi / T or -pi / T: both are right."""
    period, exact = 2.0, np.array([-1.0 + 1j * np.pi / 2, -2.0, -3.0 + 0.3j, -3.0 - 0.3j])
    folded = exact.copy()
    folded[0] -= 1j * np.pi
    assert compare_exponents(folded, exact, period) < 1e-15
    assert compare_exponents(folded + 1e-6, exact, period) == pytest.approx(1e-6 / np.abs(exact).min())
    assert compare_exponents(np.delete(folded, 1), exact, period) > 0.1


def test_a_one_way_motion_is_refused():
    moves = {"kind": "point-to-point", "move_time": 1.0, "course": "one-way", "joints": [{"waypoints": [0.0, 1.0]}]}
    with pytest.raises(InputError):
        cost(fl.load_scene("single-link", {"motion": moves, "designs": []}))


def test_command_writes_page_and_record(tmp_path, capsys, monkeypatch):
    """Of two quick stages; nothing measured in the time is exit code 4."""
    trials = [Trial("gauss 8", f"{n} segments", lambda n=n: 0.1**n) for n in (1, 3, 5)]
    rows = [row for stage in ("exponents", "forced response") for row in measure_trials(stage, trials, abs)]
    chosen = [replace(row, chosen="1e-03") if row.setting == "3 segments" else row for row in rows]
    short = CostResult("by hand", tuple(chosen), 1e-14)
    for found, code, said in ((short, 0, "cheapest"), (CostResult("t", (), 0.0, ("left out",)), 4, "left out")):
        monkeypatch.setattr("flexlin.analyses.accuracy.cost", lambda scene, seconds, found=found: found)
        assert main(["cost", "single-link", "--out", str(tmp_path / said)]) == code
        record = json.loads((tmp_path / said / "cost.json").read_text())
        assert record["notes"] == list(found.notes)
        assert [row["error"] for row in record["rows"]] == [row.error for row in found.rows]
        assert said in capsys.readouterr().out
    page = (tmp_path / "cheapest" / "cost.html").read_text()
    assert "<svg" in page
    assert "choice" in page
