"""The studies of control, small: tip tracking, Kane's spin-up, the survival of designs, and tuning."""

import numpy as np
import pytest


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
