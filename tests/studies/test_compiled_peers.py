"""The race with compiled peers, small: everybody gives the same exponents. Times are printed, never tested."""

from importlib.util import find_spec

import numpy as np
import pytest


@pytest.mark.peers
@pytest.mark.slow
@pytest.mark.skipif(find_spec("numba") is None, reason="numba is not installed")
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


@pytest.mark.peers
@pytest.mark.slow
@pytest.mark.skipif(find_spec("numba") is None, reason="numba is not installed")
def test_the_peers_are_of_the_orders_that_they_claim(study):
    """Halving the steps, three times, divides the error by 2^6 (Magnus) and 2^8 (DOP853) each time."""
    race = study("compiled_peers")
    data = race.two_harmonics(4, 1)
    peers, T = race.plain_peers(4), 2 * np.pi
    exact = peers["DOP853"](T, race.FINEST, 0.0, *data)
    for name, order, extra in (("Magnus 6, Pade", 6, ()), ("Magnus 6, Taylor", 6, ()), ("DOP853", 8, (0.0,))):
        errors = [np.abs(peers[name](T, k, *extra, *data) - exact).max() for k in (8, 64)]
        assert np.log2(errors[0] / errors[1]) / 3 == pytest.approx(order, abs=0.5)


def test_without_numba_the_study_times_designs_alone(study, tmp_path, monkeypatch, capsys):
    race = study("compiled_peers")
    monkeypatch.setattr(race, "NUMBA", False)
    data = race.main(size="small", out=tmp_path)
    assert {row["group"] for row in data["rows"]} == {"periodic LQR"}
    assert "numba is not installed" in capsys.readouterr().out
