"""The studies, small: known answers, identities and laws, and pictures that show what was found; no time is judged here."""

import json
import shutil

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin import symbolic


@pytest.mark.slow
def test_khang_2019(study, pictures, tmp_path):
    """Identities to rounding, and the false divergence at the first frequency."""
    result = study("khang_2019").main(size="small", out=tmp_path)
    assert result["difference"] < 1e-13
    paper, stiff = result["series"].values()
    for label, data in result["series"].items():
        np.testing.assert_array_equal(pictures.curves("khang_2019.svg", 0)[label], [data.ratio, data.stiffness])
        np.testing.assert_array_equal(pictures.curves("khang_2019.svg", 1)[label], [data.ratio, data.margin])
    assert np.all(np.diff(paper.stiffness) < 0)
    assert np.all(np.diff(stiff.stiffness) > 0)
    assert set(stiff.verdicts) == {"stable"}
    fast = paper.ratio > 1.0
    assert {verdict for verdict, over in zip(paper.verdicts, fast, strict=True) if over} == {"unstable"}
    assert {verdict for verdict, over in zip(paper.verdicts, fast, strict=True) if not over} == {"stable"}


@pytest.mark.slow
def test_two_link(study, pictures, tmp_path):
    """Printed frequencies, and a verdict that is missed without dM/ds s''."""
    module = study("two_link")
    result = module.main("small", tmp_path)
    np.testing.assert_allclose(result["shapes"], module.PRINTED, atol=0.005)
    assert result["coupled"].shape == (5, 4)
    whole, without, _ = result["sweeps"].values()
    assert whole.margin[0] < -whole.error[0]
    assert whole.margin[1] > whole.error[1]  # parametric resonance near 0.6 Hz ...
    assert without.margin[1] < -without.error[1]  # ... which a K_L without its first term does not see
    for label, data in result["sweeps"].items():
        np.testing.assert_array_equal(pictures.curves("two_link.svg", 1)[label], [data.frequency, data.margin])
    frequencies = [line.get_ydata() for line in pictures["two_link.svg"].axes[0].lines]
    np.testing.assert_array_equal(np.transpose(frequencies), result["coupled"])


@pytest.mark.slow
def test_modes_and_effects(study, pictures, tmp_path):
    """Errors fall with modes, and the effects that matter are those of the audit."""
    rows = {row.version: row for row in study("modes_and_effects").main("small", tmp_path)}
    one, two = rows["1 modes"], rows["2 modes"]
    assert two.frequency < one.frequency / 10
    assert two.tip < one.tip
    assert one.instructions < two.instructions
    assert rows["without gravity"].tip > 0.1
    assert rows["without payload"].frequency > 0.1
    assert rows["without rotary_inertia"].frequency < 0.01
    assert {"without shear", "without geometric_stiffening", "without modal_damping"} <= set(rows)
    drawn = pictures.curves("modes_and_effects.svg")
    modes = [row for row in rows.values() if row.version.endswith("modes")]
    curve = next(points for label, points in drawn.items() if label.startswith("tip: modes 1 to"))
    assert curve.T.tolist() == [[row.instructions, row.tip] for row in modes]
    written = {text.get_text() for text in pictures["modes_and_effects.svg"].axes[0].texts}
    assert written == {row.version.removeprefix("without ") for row in rows.values() if "without" in row.version}


@pytest.mark.slow
def test_the_fit_beats_the_data_sheet(study):
    """On logs that travel with the study."""
    found = study("measured_machine").compare("quanser-two-link", 6.0)
    assert all(found["fitted"][column] > found["data sheet"][column] + 3 for column in found["fitted"])
    assert min(found["fitted"].values()) > 75


@pytest.mark.slow
def test_a_third_of_the_log_is_predicted_by_the_others(study):
    """A fit that sees the third, or hands back other numbers than it found, stands out: joint 2 hardly moves there."""
    made = study("measured_machine")
    found, rings = made.leave_out("quanser-two-link", [2])
    assert rings["third 3"][0] == pytest.approx(made.measure_ring("quanser-two-link")[1][0], rel=0.03)
    assert found["third 3"] == pytest.approx(found["together"])
    assert found["third 3"]["joint_1_rad"] > 95
    assert min(found["third 3"][f"deflection_{k}_rad"] for k in (1, 2)) > 80
    assert 20 < found["third 3"]["joint_2_rad"] < 60


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quanser-two-link", "quanser-two-link-factory"])
def test_the_ring_is_within_three_percent(study, name):
    made = study("measured_machine")
    frequency, rate = made.predict_ring(fl.load_scene(name))
    for measured, decay in made.measure_ring(name):
        assert frequency == pytest.approx(measured, rel=0.03)
        assert 0 < rate < 2 * decay


@pytest.mark.slow
def test_all_routes_agree(study, monkeypatch):
    made = study("taylor_cost")
    monkeypatch.setattr(made, "best_time", lambda call: 0.0)
    errors = {cost.route: cost.error for cost in made.main("small")}
    assert {"dense recursion", "nested CasADi", "CasADi rootfinder", "series, numbers"} <= set(errors)
    for route, error in errors.items():
        assert error == pytest.approx(errors["dense recursion"], rel=1e-8), route
    assert errors["dense recursion"] == pytest.approx(1.24e-4, rel=0.01)


def test_remainders_fall_with_the_order(study):
    costs = study("taylor_variables").main("small")
    for tool in {cost.tool for cost in costs}:
        errors = [cost.error for cost in costs if cost.tool == tool]
        assert errors[0] > 20 * errors[1] > 400 * errors[2] > 0, tool


@pytest.mark.slow
def test_five_bar_taylor(study, pictures, tmp_path):
    """Errors fall with the order on all trajectories, the radius is the distance to the reach circles, and both are what is drawn."""
    data = study("five_bar_taylor").main("small", tmp_path)
    assert data.errors.shape == (10, 4)
    assert np.all(np.diff(data.errors, axis=0) < 0)
    assert data.errors[4] == pytest.approx([9.380e-7, 2.041e-4, 1.840e-4, 4.770e-4], rel=1e-3)
    assert data.errors[9, 0] < 3e-10
    assert data.radius_gap < 1e-6
    assert set(data.kinds) == {"real singularity"}
    assert data.error_ratio < 0.2  # at half the radius
    drawn = pictures.curves("five_bar_taylor.png", 1)
    radius = drawn["radius of convergence"][0][0]
    inside = [np.interp(radius / 2, *drawn[f"order {order}"]) for order in range(1, 11)]
    assert np.all(np.diff(inside) < 0)
    edge = pictures.curves("five_bar_taylor.png", 2)["radius of convergence"]
    assert edge.shape == (2, len(data.radii))
    lines = pictures["five_bar_taylor.png"].axes[2].lines
    centre = np.array(next(line for line in lines if line.get_marker() == "+").get_data())
    assert np.linalg.norm(edge - centre.reshape(2, 1), axis=0) == pytest.approx(data.radii)


@pytest.mark.slow
def test_own_error(study, tmp_path):
    """No claim is missed by more than its factor, no verdict is wrong."""
    module = study("own_error")
    result = module.main("small", tmp_path, workers=1)
    rows, total = result["rows"], result["total"]
    assert [row["kind"] for row in rows] == list(module.COUNTS)
    assert sum(row["cases"] for row in rows) >= len(rows)
    assert sum(row["crashed"] for row in rows) == 0
    assert sum(row["wrong"] for row in rows) == 0
    assert total.missed3 == 0
    assert total.missed <= 1
    assert total.answered > 0.8 * total.cases
    assert (tmp_path / "own_error.json").stat().st_size > 1000


def test_the_table_counts_what_the_judge_found(study):
    module = study("own_error")
    found = [
        module.Outcome(2, 1e-9, (0.5, 4.0), (2.0, 10.0), verdict="stable", wrong="stable, growth is 1", seconds=0.1),
        module.Outcome(2, 1e-9, (1.5,), (6.0,), hidden=1, verdict="undecided", seconds=0.2),
        module.Outcome(2, 1e-9, refusal="TooManySegments", seconds=0.3),
        module.Outcome(2, 1e-9, crash="ValueError: no", seconds=0.4),
    ]
    row = module.summed("some", found)
    assert (row.cases, row.answered, row.refused, row.crashed, row.wrong) == (4, 2, 1, 1, 1)
    assert (row.exponents, row.missed, row.missed3, row.worst, row.overestimate) == (3, 2, 1, 4.0, 6.0)
    assert row.undecided == 1
    lines = module.findings("some", 1, found)
    assert len(lines) == 3
    assert "1000001: n = 2" in lines[1]


@pytest.mark.slow
def test_scaling(study, pictures, tmp_path, monkeypatch):
    module = study("scaling")
    monkeypatch.setattr(module, "compiled", lambda function, folder: None)
    result = module.main("small", tmp_path)
    sizes = [(c.links, c.modes, c.coordinates) for c in result["costs"]]
    assert sizes == [(1, 0, 1), (2, 0, 2), (3, 0, 3), (1, 1, 2), (2, 1, 4), (3, 1, 6)]
    square = [module.Cost(0, 0, n, 7 * n**2, *[1] * 6) for n in (3, 5, 9)]
    assert module.exponent(square, "residual") == pytest.approx(2)
    assert np.isfinite(result["costs"][3].floquet)
    drawn = pictures.curves("scaling.svg", 0)
    assert drawn["1 modes"].T.tolist() == [[c.coordinates, c.residual] for c in result["costs"] if c.modes == 1]


@pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler")
def test_compiled_code_gives_the_same_numbers(study, tmp_path):
    """Compiled twice under one name: the second call must not get the first library. Often enough called for a tape of its own."""
    x, points = ca.SX.sym("x", 2), np.linspace(0.1, 0.9, 8000).reshape(-1, 2)
    for expression in (ca.sin(x) * x[0], ca.cos(x) + x[1]):
        function = ca.Function("f", [x], [expression])
        fast = study("scaling").compiled(function, tmp_path)
        np.testing.assert_allclose(
            symbolic.evaluate(fast, points)[0], symbolic.evaluate(function, points)[0], rtol=1e-15
        )


def test_without_a_compiler_nothing_is_compiled(study, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    x = ca.SX.sym("x")
    assert study("scaling").compiled(ca.Function("f", [x], [x]), tmp_path) is None
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_tracking(study, pictures, tmp_path):
    data = study("tracking").main(size="small", out=tmp_path)["data"]
    assert np.all(data.gain > 20)
    assert data.nonlinear["tip-exact"] == pytest.approx(data.linear["tip-exact"], rel=0.2)
    errors = pictures.curves("tracking.svg", 1)  # in mm
    np.testing.assert_allclose(errors["tip-exact, nonlinear"], [data.frequencies, 1e3 * data.nonlinear["tip-exact"]])
    phase, distance = pictures.curves("tracking.svg", 0)["rigid"]
    assert np.ptp(phase) == pytest.approx(1)
    assert distance.max() == pytest.approx(1e3 * data.nonlinear["rigid"][0], rel=1e-9)


@pytest.mark.slow
def test_spin_up(study, pictures, tmp_path):
    """Kane, Ryan, Banerjee (1987); Simo, Vu-Quoc: the largest lag is 0.574 m near 6.8 s; without stiffening it diverges."""
    stiff, without = study("spin_up").main(size="small", out=tmp_path).values()
    lag, time = stiff.lag
    assert lag == pytest.approx(0.574, abs=0.001)
    assert time == pytest.approx(6.8, abs=0.15)
    assert abs(stiff.tip[-1]) < 0.02
    assert without.t[-1] < 15
    drawn = pictures.curves("spin_up.svg")
    np.testing.assert_array_equal(drawn["with geometric stiffening"], [stiff.t, stiff.tip])
    np.testing.assert_array_equal(drawn["without"], [without.t, without.tip])


@pytest.mark.slow
def test_lqr_designs(study, pictures, tmp_path):
    result = study("lqr_designs").main(size="small", out=tmp_path)
    assert np.all(result["survival"].own["periodic"] < 0)
    cells = {axes.get_title(): axes.collections[0] for axes in pictures["lqr_designs.svg"].axes if axes.get_title()}
    for label, part in (("made for each arm", "own"), ("kept from the first arm", "kept")):
        for name, rates in getattr(result["survival"], part).items():
            np.testing.assert_array_equal(np.ravel(cells[f"{name},\n{label}"].get_array()), rates.ravel())


@pytest.mark.slow
def test_tuning_grid(study):
    """Not worse than two percent below the best of a grid, and stable on random scenarios."""
    for found in study("tuning_grid").check_all(size="small").values():
        assert found["tuned"] <= 0.98 * found["grid"] < 0
        assert found["random"] <= 0.98 * found["tuned"] < 0
        assert found["tuned"] <= 2 * found["before"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "part", ["check", "commands", "whole", "inputs", "kills", "files", "disks", "writers", "memory", "misuse"]
)
def test_torture(part, study, pictures, tmp_path, monkeypatch):
    """Nothing uncaught, nothing without a key, no set mixed or half, nothing left over."""
    module = study("torture")
    monkeypatch.setattr("tests.torture.trial.WATCHED", part not in ("check", "commands", "files", "disks"))
    monkeypatch.setattr("tests.torture.fuzzing.SECONDS", 1.0)  # how punctual they are, the study measures
    monkeypatch.setattr("tests.torture.fuzzing.LATEST", 20.0)
    found = module.main("small", tmp_path, (part,), number=7)["rows"]
    if part == "disks" and not found:
        pytest.skip("this user may not mount a disk; tests/files/test_single_files.py limits the size of files instead")
    (row,) = found
    assert row["wrong"] == []
    assert (row["uncaught"], row["keyless"], row["mixed"], row["left"]) == (0, 0, 0, 0)
    assert row["runs"] >= module.SIZES["small"][part]
    assert json.loads((tmp_path / f"torture-{part}-7.json").read_text())["runs"] == row["runs"]
    assert pictures["torture.svg"].axes[0].get_title().startswith("Runs")
