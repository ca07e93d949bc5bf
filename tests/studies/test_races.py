"""Races with other programs, small: everybody gives the same answer, and every value is right. Times are printed, never tested."""

from importlib.util import find_spec

import numpy as np
import pytest

pytestmark = pytest.mark.slow
numba = pytest.mark.skipif(find_spec("numba") is None, reason="numba is not installed")


@numba
@pytest.mark.peers
def test_every_program_gives_the_same_exponents(study, pictures, tmp_path):
    data = study("compiled_peers").main(size="small", out=tmp_path)
    assert all(row["reached"] for row in data["rows"])
    programs = {(row["group"], row["program"]) for row in data["rows"]}
    for group in ("4 states", "link, 1 mode"):
        assert (group, "flexlin") in programs
    assert ("4 states", "Magnus 6, Pade") in programs
    assert ("link, 1 mode", "DOP853, CasADi's C, equal steps") in programs
    assert set(data["ratios"]) >= {"4 states", "link, 1 mode"}
    assert "compiled_peers.svg" in pictures
    assert (tmp_path / "compiled_peers.json").exists()


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


def test_charts_speed(study, pictures, tmp_path):
    data = study("charts_speed").main(size="small", out=tmp_path)
    assert max(row["distance_in_tol"] for row in data["rows"]) < 1
    assert "flexlin, all exponents" in data["peers_us"]
    assert (tmp_path / "charts_speed.json").exists()
    assert "charts_speed.svg" in pictures
    assert set(data["sharing"]) == {"one process, s", "two threads", "two processes"}


def test_simulation_race(study, tmp_path, pictures):
    data = study("simulation_race").main(size="small", out=tmp_path)
    by_program = {(row["program"], row["tol"]): row["error"] for row in data["rows"]}
    assert by_program[("flexlin, with its error", 1e-4)] < 1e-4
    theirs = {error for (program, tol), error in by_program.items() if program.startswith("LSODA") and tol == 1e-12}
    assert max(theirs) < 1e-8  # LSODA's error is some 100 times its tolerance here
    (own,) = data["compared"]
    assert set(own["peers"]) == {program for program, _ in by_program if program.startswith("LSODA")}
    assert set(pictures.curves("simulation_race.svg")) == {program for program, _ in by_program}


def test_riccati_race(study, pictures, tmp_path):
    times = study("riccati_race").main(size="small", out=tmp_path)
    assert set(times) == {"link, rigid", "satellite, 6 states"}
    assert all(error < 1e-3 for found in times.values() for _, error in found.values())
    assert len(pictures["riccati_race.svg"].axes[0].patches) == 14


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
    assert (tmp_path / "cost_of_accuracy.json").exists()
