"""The studies, small: known answers, identities and laws, and races with other programs, where everybody
gives the same answer and every value is right; no time is judged here."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

import flexlin as fl

pytestmark = pytest.mark.slow


def test_khang_2019(study, tmp_path):
    """Identities to rounding, and the false divergence at the first frequency."""
    result = study("khang_2019").main(size="small", out=tmp_path)
    assert result["difference"] < 1e-13
    paper, stiff = result["series"].values()
    assert np.all(np.diff(paper.stiffness) < 0)
    assert np.all(np.diff(stiff.stiffness) > 0)
    assert set(stiff.verdicts) == {"stable"}
    assert paper.verdicts == tuple(np.where(paper.ratio > 1.0, "unstable", "stable"))


def test_two_link(study, tmp_path):
    """Printed frequencies, and a verdict that is missed without dM/ds s''."""
    module = study("two_link")
    result = module.main("small", tmp_path)
    np.testing.assert_allclose(result["shapes"], module.PRINTED, atol=0.005)
    assert result["coupled"].shape == (5, 4)
    whole, without, _ = result["sweeps"].values()
    assert whole.margin[0] < -whole.error[0]
    assert whole.margin[1] > whole.error[1]  # parametric resonance near 0.6 Hz ...
    assert without.margin[1] < -without.error[1]  # ... which a K_L without its first term does not see


def test_modes_and_effects(study, tmp_path):
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


def test_the_fit_beats_the_data_sheet(study):
    """On logs that travel with the study; a third of the log is predicted by the others: a fit that sees it, or hands back other numbers
    than it found, stands out, for joint 2 hardly moves there."""
    made = study("measured_machine")
    found = made.compare("quanser-two-link", 6.0)
    assert all(found["fitted"][column] > found["data sheet"][column] + 3 for column in found["fitted"])
    assert min(found["fitted"].values()) > 75
    found, rings = made.leave_out("quanser-two-link", [2])
    assert rings["third 3"][0] == pytest.approx(made.measure_ring("quanser-two-link")[1][0], rel=0.03)
    assert found["third 3"] == pytest.approx(found["together"])
    assert found["third 3"]["joint_1_rad"] > 95
    assert min(found["third 3"][f"deflection_{k}_rad"] for k in (1, 2)) > 80
    assert 20 < found["third 3"]["joint_2_rad"] < 60


@pytest.mark.parametrize("name", ["quanser-two-link", "quanser-two-link-factory"])
def test_the_ring_is_within_three_percent(study, name):
    made = study("measured_machine")
    frequency, rate = made.predict_ring(fl.load_scene(name))
    for measured, decay in made.measure_ring(name):
        assert frequency == pytest.approx(measured, rel=0.03)
        assert 0 < rate < 2 * decay


def test_all_routes_agree(study, monkeypatch):
    made = study("taylor_cost")
    monkeypatch.setattr(made, "best_time", lambda call: 0.0)
    errors = {cost.route: cost.error for cost in made.main("small")}
    assert {"nested CasADi", "CasADi rootfinder", "series, numbers"} <= set(errors)
    assert errors == pytest.approx(dict.fromkeys(errors, errors["nested CasADi"]), rel=1e-8)
    assert errors["nested CasADi"] == pytest.approx(1.24e-4, rel=0.01)


def test_five_bar_taylor(study, tmp_path):
    """Errors fall with the order on all trajectories, the radius is the distance to the reach circles, and both are what is drawn."""
    data = study("five_bar_taylor").main("small", tmp_path)
    assert data.errors.shape == (10, 4)
    assert np.all(np.diff(data.errors, axis=0) < 0)
    assert data.errors[4] == pytest.approx([9.380e-7, 2.041e-4, 1.840e-4, 4.770e-4], rel=1e-3)
    assert data.errors[9, 0] < 3e-10
    assert data.radius_gap < 1e-6
    assert set(data.kinds) == {"real singularity"}
    assert data.error_ratio < 0.2  # at half the radius


def test_own_error(study, tmp_path):
    """No claim is missed by more than its factor, no verdict is wrong."""
    module = study("own_error")
    result = module.main("small", tmp_path, workers=1)
    rows, total = result["rows"], result["total"]
    assert [row["kind"] for row in rows] == list(module.COUNTS)
    assert sum(row["crashed"] + row["wrong"] for row in rows) == 0
    assert total.missed3 == 0
    assert total.missed <= 1
    assert total.answered > 0.8 * total.cases


def test_scaling(study, tmp_path, monkeypatch):
    module = study("scaling")
    monkeypatch.setattr(module, "compiled", lambda function, folder: None)
    result = module.main("small", tmp_path)
    sizes = [(c.links, c.modes, c.coordinates) for c in result["costs"]]
    assert sizes == [(links, modes, links * (1 + modes)) for modes in (0, 1) for links in (1, 2, 3)]
    square = [module.Cost(0, 0, n, 7 * n**2, *[1] * 6) for n in (3, 5, 9)]
    assert module.exponent(square, "residual") == pytest.approx(2)
    assert np.isfinite(result["costs"][3].floquet)


def test_tracking(study, tmp_path):
    data = study("tracking").main(size="small", out=tmp_path)["data"]
    assert np.all(data.gain > 20)
    assert data.nonlinear["tip-exact"] == pytest.approx(data.linear["tip-exact"], rel=0.2)


def test_spin_up(study, tmp_path):
    """Kane, Ryan, Banerjee (1987); Simo, Vu-Quoc: the largest lag is 0.574 m near 6.8 s; without stiffening it diverges."""
    stiff, without = study("spin_up").main(size="small", out=tmp_path).values()
    assert stiff.lag[0] == pytest.approx(0.574, abs=0.001)
    assert stiff.lag[1] == pytest.approx(6.8, abs=0.15)
    assert abs(stiff.tip[-1]) < 0.02
    assert without.t[-1] < 15


def test_lqr_designs(study, tmp_path):
    result = study("lqr_designs").main(size="small", out=tmp_path)
    assert np.all(result["survival"].own["periodic"] < 0)


def test_tuning_grid(study):
    """Not worse than two percent below the best of a grid, and stable on random scenarios."""
    for found in study("tuning_grid").check_all(size="small").values():
        assert found["tuned"] <= 0.98 * found["grid"] < 0
        assert found["random"] <= 0.98 * found["tuned"] < 0
        assert found["tuned"] <= 2 * found["before"]


PARTS = ("check", "commands", "whole", "inputs", "kills", "files", "disks", "writers", "memory", "misuse")


@pytest.mark.parametrize("part", PARTS)
def test_torture(part, study, tmp_path, monkeypatch):
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


numba = pytest.mark.skipif(find_spec("numba") is None, reason="numba is not installed")


@numba
@pytest.mark.peers
def test_every_program_gives_the_same_exponents(study, tmp_path):
    data = study("compiled_peers").main(size="small", out=tmp_path)
    assert all(row["reached"] for row in data["rows"])
    programs = {(row["group"], row["program"]) for row in data["rows"]}
    for group in ("4 states", "link, 1 mode"):
        assert (group, "flexlin") in programs
    assert ("4 states", "Magnus 6, Pade") in programs
    assert ("link, 1 mode", "DOP853, CasADi's C, equal steps") in programs


@numba
@pytest.mark.peers
def test_the_peers_are_of_the_orders_that_they_claim(study):
    """Halving the steps, three times, divides the error by 2^6 (Magnus) and 2^8 (DOP853) each time."""
    race = study("compiled_peers")
    data = race.two_harmonics(4, 1)
    peers, T = race.plain_peers(4), 2 * np.pi
    exact = peers["DOP853"](T, race.FINEST, 0.0, *data)
    for name, order, extra in (("Magnus 6, Pade", 6, ()), ("Magnus 6, Taylor", 6, ()), ("DOP853", 8, (0.0,))):
        errors = [np.abs(peers[name](T, k, *extra, *data) - exact).max() for k in (8, 64)]
        assert np.log2(errors[0] / errors[1]) / 3 == pytest.approx(order, abs=0.5)


def test_charts_speed(study, tmp_path):
    data = study("charts_speed").main(size="small", out=tmp_path)
    assert max(row["distance_in_tol"] for row in data["rows"]) < 1
    assert "flexlin, all exponents" in data["peers_us"]
    assert set(data["sharing"]) == {"one process, s", "two threads", "two processes"}


def test_simulation_race(study, tmp_path):
    data = study("simulation_race").main(size="small", out=tmp_path)
    by_program = {(row["program"], row["tol"]): row["error"] for row in data["rows"]}
    assert by_program[("flexlin, with its error", 1e-4)] < 1e-4
    theirs = {error for (program, tol), error in by_program.items() if program.startswith("LSODA") and tol == 1e-12}
    assert max(theirs) < 1e-8  # LSODA's error is some 100 times its tolerance here
    (own,) = data["compared"]
    assert set(own["peers"]) == {program for program, _ in by_program if program.startswith("LSODA")}


def test_riccati_race(study, tmp_path):
    times = study("riccati_race").main(size="small", out=tmp_path)
    assert set(times) == {"link, rigid", "satellite, 6 states"}
    assert all(error < 1e-3 for found in times.values() for _, error in found.values())


MULTISTEP = ("CasADi cvodes", "SciPy LSODA")
"""They need smaller tolerances than the small run tries."""


def test_cost_of_accuracy(study, tmp_path):
    """With heyoka where it is installed; without it the study leaves it out, as its message says."""
    data = study("cost_of_accuracy").main(size="small", out=tmp_path)
    reached = {row["program"]: row["reached"] for row in data["rows"]}
    assert reached["flexlin, all exponents"]
    assert reached["flexlin, transition matrix"]
    assert reached["SciPy DOP853"]
    assert not find_spec("heyoka") or reached["heyoka, evaluation alone"]
    assert max(row["error"] for row in data["rows"] if row["program"] not in MULTISTEP) < 1e-10
    assert data["batch_error"] < 1e-8
