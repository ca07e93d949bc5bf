"""The figures of cost: every stage is there, errors fall as settings get finer, and the cheapest is the cheapest."""

import json

import numpy as np
import pytest

import flexlin as fl
from flexlin.about.free import parametric_loop
from flexlin.answers.accuracy import CostResult, Row, cost
from flexlin.answers.accuracy import own_stages as own
from flexlin.answers.peers import import_heyoka, prepare_cvodes, prepare_scipy
from flexlin.cli.main import main
from flexlin.errors import ArgumentError, InputError
from flexlin.periodic.transition.setting import Setting


@pytest.fixture(scope="module")
def scene():
    overrides = {"links.0.modes": 1, "designs": [], "effects.hub.inertia": 0.02, "control.feedback.kd.0": 0.1}
    return fl.load_scene("single-link", overrides)


@pytest.fixture(scope="module")
def result(scene):
    return cost(scene, peers=False)


def test_every_stage_is_measured_with_errors_that_reach_the_floor(result):
    for stage in ("coefficients", "transition matrices", "exponents", "periodic Riccati", "forced response"):
        rows = result.stage(stage)
        assert min(row.error for row in rows) < 1e-9, stage
        assert all(row.seconds > 0 for row in rows)
    assert {row.stage for row in result.rows} >= {"number of modes", "Taylor order"}
    assert result.floor < 1e-11
    assert result.notes == ()


def test_finer_settings_are_more_accurate_at_their_order(result):
    gauss = {row.setting: row.error for row in result.stage("transition matrices") if row.method == "gauss 8"}
    assert np.log2(gauss["32 segments"] / gauss["64 segments"]) == pytest.approx(8, abs=0.7)
    orders = [row.error for row in result.stage("Taylor order")]
    assert orders == sorted(orders, reverse=True)


def test_the_engines_choice_is_marked_at_each_tol_and_reaches_it(result):
    for stage in ("exponents", "periodic Riccati", "forced response"):
        marked = {float(row.chosen): row for row in result.stage(stage) if row.chosen}
        assert sorted(marked) == sorted(own.TOLS)
        assert all(row.error <= tol for tol, row in marked.items()), stage


def test_recommendations_of_a_table_whose_answer_is_known():
    """Found out: another program or another stage recommended, one that is fast but too coarse, a repeated row."""
    coarse = Row("exponents", "own", "coarse", 3e-3, 1.0)
    middle = Row("exponents", "own", "middle", 2e-5, 2.0)
    slow = Row("exponents", "own", "slow and worse", 9e-5, 7.0)
    fine = Row("exponents", "own", "fine", 1e-9, 5.0)
    others = (
        Row("exponents", "another program", "fast", 1e-11, 0.1, outside=True),
        Row("forced response", "own", "of another stage", 1e-12, 0.1),
    )
    table = CostResult("by hand", (slow, fine, others[0], coarse, others[1], middle), 1e-14)
    found = [(accuracy, row) for stage, accuracy, row in table.recommendations() if stage == "exponents"]
    assert found == [(1e-2, coarse), (pytest.approx(1e-3), middle), (pytest.approx(1e-5), fine)]


def test_recommendations_of_a_scene_meet_their_accuracy(result):
    """Every own stage has a recommendation, and each is one of the measured rows, accurate enough, of flexlin's own."""
    found = list(result.recommendations())
    assert {stage for stage, *_ in found} == {row.stage for row in result.rows}
    assert all(best.error <= accuracy and best in result.rows and not best.outside for _, accuracy, best in found)


def test_cheapest_in_a_table_made_by_hand():
    rows = (
        Row("exponents", "a", "1", 1e-3, 1.0),
        Row("exponents", "b", "1", 1e-6, 2.0),
        Row("exponents", "c", "1", 1e-5, 3.0),
    )
    found = CostResult("by hand", rows, 1e-15).marked()
    assert [row.cheapest for row in found.rows] == [True, True, False]
    assert found.cheapest("exponents", 1e-4).method == "b"
    assert found.cheapest("exponents", 1e-9) is None


def test_outside_programs_integrate_the_same_equations(scene):
    loop = parametric_loop(scene, ["effects.payload.mass"])
    exact = own.multiply_period(loop.linearization.periodic_system(), Setting("gauss", 20, 64, ""))
    for transition, tol in ((prepare_scipy(loop, "DOP853", 1e-9), 1e-8), (prepare_cvodes(loop, 1e-9), 1e-5)):
        assert np.abs(transition(loop.nominal) - exact).max() < tol * np.abs(exact).max()
    with pytest.raises(ArgumentError, match="peers"):
        import_heyoka("no_such_module_heyoka")


def test_a_one_way_motion_is_refused():
    joints = [{"waypoints": [0.0, 1.0]}]
    moves = {"kind": "point-to-point", "move_time": 1.0, "course": "one-way", "joints": joints}
    with pytest.raises(InputError):
        cost(fl.load_scene("single-link", {"motion": moves, "designs": []}))


def test_command_writes_page_and_record(result, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("flexlin.answers.accuracy.cost", lambda scene: result)
    assert main(["cost", "single-link", "--out", str(tmp_path)]) == 0
    record = json.loads((tmp_path / "cost.json").read_text())
    assert len(record["rows"]) == len(result.rows)
    assert {"stage", "method", "setting", "error", "seconds", "chosen"} <= set(record["rows"][0])
    page = (tmp_path / "cost.html").read_text()
    assert "<svg" in page
    assert "choice" in page
    assert "cheapest" in capsys.readouterr().out
